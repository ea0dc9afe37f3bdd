"""Files that are whole or absent, processes that end, predictions that last."""
