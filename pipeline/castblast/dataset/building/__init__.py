"""Building a dataset: shards by workers, put together, or added to another."""
