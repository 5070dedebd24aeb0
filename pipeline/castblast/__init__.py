"""castblast: from explosive, rock and bench to burden velocity and muckpile."""

__version__ = "0.1.0"
