"""Refinement of mirror planes, usable after any method, and what M4 shares with it: its steps 1, 3 and 4."""

from symshrec.methods.fit.refinement import Refined, RefineSettings, refine_planes, refined

REFINEMENT_VERSION = 3  # counts up whenever refined planes change

__all__ = ["REFINEMENT_VERSION", "RefineSettings", "Refined", "refine_planes", "refined"]
