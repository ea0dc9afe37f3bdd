"""Geometry that methods and people's tools share."""
