"""Timings as ratios, and the plain implementations they are measured against."""
