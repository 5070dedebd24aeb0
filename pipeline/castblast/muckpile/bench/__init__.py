"""The bench before firing: shape, rock around it, sizes, packing, timing."""
