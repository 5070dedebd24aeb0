"""Pictures of benches and piles, and files for viewers."""
