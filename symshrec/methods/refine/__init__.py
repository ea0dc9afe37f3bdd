"""Point-to-plane refinement of mirror planes, usable after any method, and step 4 of M4."""

from symshrec.methods.refine.refinement import Refined, RefineSettings, refine_planes, refined

__all__ = ["RefineSettings", "Refined", "refine_planes", "refined"]
