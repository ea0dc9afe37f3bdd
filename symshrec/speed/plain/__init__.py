"""Plain, slow, obvious implementations that tests and benchmarks hold the product against."""
