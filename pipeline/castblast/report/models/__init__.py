"""Pictures of models: errors, league, curves, tuning."""
