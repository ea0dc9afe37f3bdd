"""§3.3 step 1 and Eq. 5: the Laplacian spectrum of a cloud and the diffusion function S on it."""

import numpy as np
import robust_laplacian
from scipy.sparse.linalg import LinearOperator, eigsh, splu

SHIFT = 1e-8  # of the shift-inverted eigenproblem, in units of 1 / length²
ZERO_EIGENVALUE = 1e-7  # relative to the largest of those computed
JITTER = 1e-6  # of the cloud's diagonal, where the points allow no triangulation


def laplacian_spectrum(
    points: np.ndarray, eigenpairs: int, mollify: float, laplacian_neighbours: int
) -> tuple[np.ndarray, np.ndarray]:
    """The smallest eigenpairs of L φ = λ M φ, L and M being the robust point cloud Laplacian (Sharp and Crane 2020).

    The same points in the same order give the same result to the bit. Points that allow no local triangulation (a
    straight run of neighbours, for one) are moved by `JITTER` and tried again.

    Args:
        points: (N, 3) float64, N ≥ 4, distinct, of diagonal 1.
        eigenpairs: how many; N − 1 where that is less.
        mollify: mollification factor of the triangulation, relative to its mean edge length.
        laplacian_neighbours: neighbours in the local triangulations; N − 1 where that is less.

    Returns:
        Eigenvalues (E,), ascending and not negative, and eigenvectors (N, E), orthonormal in M.

    Raises:
        RuntimeError: where the moved points fail as well.
    """
    arguments = min(eigenpairs, len(points) - 1), mollify, min(laplacian_neighbours, len(points) - 1)
    try:
        return _spectrum(points, *arguments)
    except RuntimeError:
        jitter = np.random.default_rng(0).uniform(-JITTER, JITTER, points.shape)
        return _spectrum(points + jitter, *arguments)


def _spectrum(points, eigenpairs, mollify, neighbours):
    laplacian, mass = robust_laplacian.point_cloud_laplacian(points, mollify_factor=mollify, n_neighbors=neighbours)
    # Symmetric ordering without pivoting: half the time of SuperLU's default, and safe on this all but definite matrix.
    factors = splu(
        (laplacian - SHIFT * mass).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    eigenvalues, eigenvectors = eigsh(
        laplacian,
        eigenpairs,
        mass,
        sigma=SHIFT,
        OPinv=LinearOperator(laplacian.shape, factors.solve, dtype=np.float64),
        v0=np.random.default_rng(0).standard_normal(len(points)),
    )
    if not (np.isfinite(eigenvalues).all() and np.isfinite(eigenvectors).all()):
        raise RuntimeError("the Laplacian of the cloud has no finite spectrum")
    order = np.argsort(eigenvalues)
    return np.maximum(eigenvalues[order], 0.0), eigenvectors[:, order]


def diffusion(eigenvalues: np.ndarray, eigenvectors: np.ndarray, time_factor: float) -> np.ndarray:
    """S(x, t) = Σ (1 − e^(−λt)) / λ · φ(x)², the heat kernel's diagonal integrated over time (Eq. 5).

    Args:
        eigenvalues: (E,), not negative.
        eigenvectors: (N, E).
        time_factor: t in units of 1/λ₁, λ₁ the first eigenvalue above zero, so that t scales with the shape. Infinity
            gives Σ φ²/λ over the eigenvalues above zero, the rest being constant on a connected shape.

    Returns:
        (N,), up to a factor: for λ = 0 the limit t stands in the sum.
    """
    positive = eigenvalues > ZERO_EIGENVALUE * eigenvalues[-1]
    if not positive.any():
        return np.square(eigenvectors).sum(1)
    time = time_factor / eigenvalues[positive][0]
    weights = np.full(len(eigenvalues), time if np.isfinite(time) else 0.0)
    weights[positive] = -np.expm1(-eigenvalues[positive] * time) / eigenvalues[positive]
    return np.square(eigenvectors) @ weights
