"""The balls: records, contact law, state of a run."""
