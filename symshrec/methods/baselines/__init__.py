"""What a person would use instead of the track's methods: `pca_icp` and `ransac`, plain and nothing to train."""
