"""Reflection symmetries of 3D point clouds: the SHREC 2023 track, generated, scored, reproduced and beaten."""

__version__ = "0.1.0"
