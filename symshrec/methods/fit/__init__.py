"""Refinement of mirror planes, usable after any method, and what M4 shares with it: its steps 1, 3 and 4."""

from symshrec.methods.fit.refinement import Refined, RefineSettings, refine_planes, refined

__all__ = ["RefineSettings", "Refined", "refine_planes", "refined"]
