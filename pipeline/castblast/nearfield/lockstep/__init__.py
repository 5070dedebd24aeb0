"""Many holes at once, in lockstep."""
