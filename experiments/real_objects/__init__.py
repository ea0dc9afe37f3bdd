"""Beyond the paper: detection on real objects, meshes of PyPI's packages under what a scanner does to them."""
