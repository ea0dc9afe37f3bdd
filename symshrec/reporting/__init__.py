"""Results to tables, figures and TensorBoard."""
