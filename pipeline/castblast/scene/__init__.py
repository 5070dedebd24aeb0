"""From a bench spec to all that a cast begins with."""
