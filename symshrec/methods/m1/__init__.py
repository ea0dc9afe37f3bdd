"""§3.1 M1: every point of a sampled cloud predicts all mirror planes; the predictions are clustered into one set."""
