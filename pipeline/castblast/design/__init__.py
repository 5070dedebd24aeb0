"""What a design is: its variables, the one rule that completes and refuses, the hole."""
