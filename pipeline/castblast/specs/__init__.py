"""Specs: YAML files and quantities with units, validated once at the edge."""
