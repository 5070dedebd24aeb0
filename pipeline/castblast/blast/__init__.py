"""One blast, or many at once: inputs completed, near field, burden motion."""
