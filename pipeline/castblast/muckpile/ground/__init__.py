"""What balls fall on: walls, facets, terrain."""
