"""Mirror planes of one cloud or of many, which all parts exchange, and the point groups that they make."""

from symshrec.planes.groups import PointGroup, point_group
from symshrec.planes.planes import PackedPlanes, Planes, axis_angles
from symshrec.planes.reflections import RotationAxis

__all__ = ["PackedPlanes", "Planes", "PointGroup", "RotationAxis", "axis_angles", "point_group"]
