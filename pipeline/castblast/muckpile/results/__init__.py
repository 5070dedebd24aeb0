"""What is measured on a pile: profile, throw, movement, ore."""
