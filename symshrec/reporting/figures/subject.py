"""What `symshrec detect` draws: a shape, its numbered planes, the group that they make, and its deviations."""

from dataclasses import dataclass

import numpy as np

from symshrec.planes import Planes, PointGroup
from symshrec.reporting.figures.outlines import outline
from symshrec.scans.palette import colour_code, colour_number
from symshrec.scans.polygons import Mesh

MANY = 15  # planes, as of an icosahedron, from which they are drawn faint
MAPPED = 8  # planes that deviations can be chosen to in a page or a window
RANGE = 0.99  # share of the points whose deviation the colour bar spans


@dataclass(frozen=True, eq=False)
class Subject:
    """What there is to draw.

    Attributes:
        points: (N, 3), that planes were found on. mesh: that they are of, None of a cloud. planes: by number.
        group: of the planes; its axis of highest order is drawn where there is one.
        span: the deviation at either end of the colour bar; None: what nearly all points are below.
        deviations: (N,), signed, of the points from the mirror image in the plane `number`; None: all in grey.
    """

    points: np.ndarray
    planes: Planes
    mesh: Mesh | None = None
    group: PointGroup | None = None
    deviations: np.ndarray | None = None
    number: int = 1
    span: float | None = None

    @property
    def shown(self) -> list[int]:
        """Places of the planes that are drawn: the one that deviations are to, or all."""
        return list(range(len(self.planes))) if self.deviations is None else [self.number - 1]

    @property
    def limit(self) -> float:
        """The deviation at either end of the colour bar."""
        if self.span is not None:
            return self.span
        most = 0.0 if self.deviations is None else float(np.quantile(np.abs(self.deviations), RANGE))
        return most or 1e-12

    def outline(self, row: int) -> np.ndarray:
        """A plane's rectangle (4, 3)."""
        return outline(self.points, self.planes.normals[row], self.planes.points[row])

    @property
    def alpha(self) -> float:
        """How much a plane hides: little where there are many, or where the colours of points are to be read."""
        return 0.06 if self.deviations is not None else 0.22 if len(self.planes) <= MANY else 1.0 / len(self.planes)

    def colour(self, row: int) -> str:
        """A plane's own colour; of a surface of revolution, one for all that go through its axis."""
        return colour_code(row + 1 if self.group is None else colour_number(self.planes, self.group, row))

    def numbered(self, row: int) -> bool:
        """Whether a plane's number is drawn: not of those that stand for all planes of a revolution or a sphere."""
        return self.group is None or not self.group.continuous or row in self.group.outside or row + 1 == self.chosen

    @property
    def chosen(self) -> int | None:
        """The number of the plane that deviations are to."""
        return None if self.deviations is None else self.number

    @property
    def axis_name(self) -> str:
        """What `axis` is."""
        if self.group is None or self.group.continuous:
            return "axis of revolution"
        return f"axis of order {self.group.axes[0].order}"

    @property
    def axis(self) -> np.ndarray | None:
        """The ends (2, 3) of the group's axis of highest order, standing out a little; None where it is not alone."""
        group = self.group
        if group is None or not (group.complete or group.continuous) or not group.axes:
            return None
        if [axis.order for axis in group.axes].count(group.axes[0].order) > 1:
            return None
        direction = group.axes[0].direction
        along = (self.points - group.centre) @ direction
        ends = np.array([along.min(), along.max()]) + np.array([-0.12, 0.12]) * np.ptp(along)
        return group.centre + ends[:, None] * direction
