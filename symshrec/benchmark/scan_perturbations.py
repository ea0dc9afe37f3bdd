"""Beyond the paper: P10–P15, what a scanner and the world do to a cloud.

Each takes a clean cloud as a Scene, a generator and the config, and gives a Perturbed. Lengths are shares of the
diagonal of the clean cloud's axis-aligned box, wherever the shape lies.
"""

from collections.abc import Callable

import numpy as np

from symshrec.benchmark.config import NoiseConfig
from symshrec.benchmark.ranges import uniform_in
from symshrec.benchmark.scene import Perturbed, Scene

DENSITY_NEIGHBOURS = 8
FAR_SIDE = 0.7  # of the farthest point's distance from the plane: where P13 bites


def uneven_density(scene: Scene, rng: np.random.Generator, config: NoiseConfig) -> Perturbed:
    """P10: the density grows along a random direction, exponentially or in one step, from 1 to `density_ratio`.

    As many points as before: those that go are replaced by others of the surface, drawn at the same odds.
    """
    ratio = uniform_in(rng, config.scan.density_ratio)
    step = rng.random() < config.scan.step_probability
    direction = _direction(rng)
    depths = scene.points @ direction
    low, high = depths.min(), depths.max()
    share = uniform_in(rng, config.scan.step_share)
    edge = np.quantile(depths, share)

    def weights(points: np.ndarray, normals: np.ndarray | None) -> np.ndarray:
        depth = points @ direction
        if step:
            return np.where(depth > edge, ratio, 1.0)
        return ratio ** np.clip((depth - low) / max(high - low, np.finfo(float).tiny), 0, 1)

    parameters = {"density_ratio": ratio, "step": float(step)} | ({"step_share": share} if step else {})
    return Perturbed(_redrawn(scene, weights, rng), parameters, scene.planes)


def one_sided_scanner(scene: Scene, rng: np.random.Generator, config: NoiseConfig) -> Perturbed:
    """P11: the density of a scanner's rays, cos(angle to the normal) / distance², with nothing hidden.

    The scanner stands in a random direction, `distance` diagonals off the box's centre. As many points as before.
    """
    scanner = _viewpoint(scene, rng, config)

    def weights(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        rays = points - scanner
        distances = np.linalg.norm(rays, axis=1)
        return np.abs((rays * normals).sum(axis=1)) / distances**3

    return Perturbed(_redrawn(scene, weights, rng), _place("scanner", scanner), scene.planes)


def single_view(scene: Scene, rng: np.random.Generator, config: NoiseConfig) -> Perturbed:
    """P12: what is hidden from one side is missing, by hidden point removal (Katz, Tal and Basri, SIGGRAPH 2007).

    Every point is flipped over a sphere about the camera, whose radius is `reach` times the farthest point's distance;
    those on the convex hull of the flipped points and the camera are seen. They keep their order.
    """
    from scipy.spatial import ConvexHull  # half of a worker's start, and most data need none

    camera = _viewpoint(scene, rng, config)
    rays = scene.points - camera
    distances = np.linalg.norm(rays, axis=1, keepdims=True)
    flipped = rays * (2 * config.scan.reach * distances.max() / distances - 1)
    hull = ConvexHull(np.concatenate([flipped, np.zeros((1, 3))])).vertices
    seen = np.sort(hull[hull < len(rays)])
    return Perturbed(scene.points[seen], _place("camera", camera), scene.planes)


def cut_or_bite(scene: Scene, rng: np.random.Generator, config: NoiseConfig) -> Perturbed:
    """P13: a share of the points is missing, beyond a random plane or in a ball about a point well to one side.

    The bite's centre lies far from a true plane drawn at random, so that this plane's other side stays whole. The rest
    keep their order, and at least one stays.
    """
    points, scan = scene.points, config.scan
    bite = rng.random() < scan.bite_probability
    share = uniform_in(rng, scan.bite_fraction if bite else scan.cut_fraction)
    if bite:
        off_plane = np.abs((points - scene.centre) @ _direction(rng))
        if len(scene.planes):
            row = rng.integers(len(scene.planes))
            off_plane = np.abs(points @ scene.planes.normals[row] - scene.planes.offsets[row])
        centre = points[rng.choice(np.flatnonzero(off_plane >= FAR_SIDE * off_plane.max()))]
        depths = -np.linalg.norm(points - centre, axis=1)
    else:
        depths = points @ _direction(rng)
    removed = min(round(share * len(points)), len(points) - 1)
    keep = np.ones(len(points), dtype=bool)
    keep[np.argsort(-depths, kind="stable")[:removed]] = False
    return Perturbed(points[keep], {"removed_fraction": share, "bite": float(bite)}, scene.planes)


def floor(scene: Scene, rng: np.random.Generator, config: NoiseConfig) -> Perturbed:
    """P14: the shape stands on a square patch, `floor_width` times as wide as it, turned and off its middle at random.

    Down is −z. The patch has the points' own median density; where the whole would have more than `floor_most` times
    the points of the shape, both are thinned alike. True planes stay the shape's.
    """
    points, scan = scene.points, config.scan
    times, off = uniform_in(rng, scan.floor_width), uniform_in(rng, scan.floor_offset)
    turn, way = rng.uniform(0, 2 * np.pi, 2)
    width = times * float(np.ptp(points[:, :2], axis=0).max())
    count = round(_density(points) * width**2)
    kept = min(1.0, scan.floor_most * len(points) / (len(points) + count))
    square = rng.uniform(-width / 2, width / 2, (round(kept * count), 2))
    cosine, sine = np.cos(turn), np.sin(turn)
    patch = np.empty((len(square), 3))
    patch[:, :2] = square @ np.array([[cosine, sine], [-sine, cosine]])
    patch[:, :2] += scene.centre[:2] + off * width * np.array([np.cos(way), np.sin(way)])
    patch[:, 2] = points[:, 2].min()
    rows = np.sort(rng.permutation(len(points))[: max(round(kept * len(points)), 1)])
    parameters = {"floor_width": times, "floor_offset": off, "floor_points": float(len(patch))}
    return Perturbed(np.concatenate([points[rows], patch]), parameters, scene.planes)


def bent(scene: Scene, rng: np.random.Generator, config: NoiseConfig) -> Perturbed:
    """P15: one half of the shape is bent along a true plane drawn at random, which alone stays true.

    Of the two directions within the plane, the one in which the shape is longer bends towards the other, as the square
    of the way from the shape's local origin, by `bend` of the diagonal at the end.
    """
    share = uniform_in(rng, config.scan.bend)
    normal, origin, planes = _direction(rng), scene.centre, scene.planes
    if len(planes):
        row = rng.integers(len(planes))
        normal, origin, planes = planes.normals[row], planes.points[row], planes[[row]]
    along = _longest_within(scene.points, normal) * rng.choice([-1.0, 1.0])
    aside = np.cross(normal, along)
    way = np.maximum((scene.points - origin) @ along, 0)
    bow = share * scene.diagonal * (way / way.max()) ** 2
    points = scene.points + bow[:, None] * aside
    return Perturbed(points, {"bend": share}, planes if share else scene.planes)


SCAN: dict[str, Callable[..., Perturbed]] = {
    "P10": uneven_density,
    "P11": one_sided_scanner,
    "P12": single_view,
    "P13": cut_or_bite,
    "P14": floor,
    "P15": bent,
}


def _direction(rng: np.random.Generator) -> np.ndarray:
    """A unit vector (3,) uniform on the sphere."""
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)


def _viewpoint(scene: Scene, rng: np.random.Generator, config: NoiseConfig) -> np.ndarray:
    return scene.centre + config.scan.distance * scene.diagonal * _direction(rng)


def _place(name: str, point: np.ndarray) -> dict[str, float]:
    return {f"{name}_{axis}": float(value) for axis, value in zip("xyz", point, strict=True)}


def _redrawn(scene: Scene, weights: Callable[..., np.ndarray], rng: np.random.Generator) -> np.ndarray:
    """The cloud at a density in proportion to weights(points, normals): as many points, where possible the same.

    Rejection sampling: a point stays at the odds of its weight beside the greatest, and what goes is replaced by new
    points of the surface that pass the same test.
    """
    own = weights(scene.points, scene.normals)
    greatest = own.max()
    points = scene.points.copy()
    missing = np.flatnonzero(rng.random(len(points)) * greatest >= own)
    while len(missing):
        chart = scene.surface.draw(len(points), rng)
        fresh = scene.surface.points(chart)
        passed = fresh[rng.random(len(fresh)) * greatest < weights(fresh, scene.surface.normals(chart))]
        used = rng.permutation(passed)[: len(missing)]
        points[missing[: len(used)]] = used
        missing = missing[len(used) :]
    return points


def _density(points: np.ndarray) -> float:
    """Points per unit of surface, the median over the points of what their nearest neighbours say."""
    from scipy.spatial import cKDTree  # as in P12

    neighbours = min(DENSITY_NEIGHBOURS, len(points) - 1)
    reach = cKDTree(points).query(points, [neighbours + 1])[0]
    return float(neighbours / (np.pi * np.median(reach) ** 2))


def _longest_within(points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The unit vector (3,) across `normal` along which the points spread most."""
    centred = points - points.mean(axis=0)
    flat = centred - np.outer(centred @ normal, normal)
    along = np.linalg.eigh(np.einsum("ni,nj->ij", flat, flat))[1][:, -1]
    along -= (along @ normal) * normal
    return along / np.linalg.norm(along)
