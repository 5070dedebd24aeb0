"""One zone of rock: strength, viscosity, a step of the scheme."""
