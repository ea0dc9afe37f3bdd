"""M4, our own, training-free: `detection` for one cloud, `module` for Lightning."""
