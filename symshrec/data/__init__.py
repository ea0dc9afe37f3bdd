"""From shards to batches: the one datamodule and what it hands out."""
