"""Stages: one plain function per job of the product, paths in, paths out."""
