"""What a cast begins with: balls, and how they came about."""

from __future__ import annotations

import math
from typing import NamedTuple

from castblast.muckpile.balls.particles import Particles


class Start(NamedTuple):
    """Balls before firing and how they came about.

    Attributes
    ----------
    balls : Particles
    solid_fraction : float [-]
        Reached by the packing; NaN for a file of balls.
    settled : bool
        The packing came to rest before it was fired; True for a file of balls, as given.
    reused : bool
        The packing is that of an earlier run.
    """

    balls: Particles
    solid_fraction: float = math.nan
    settled: bool = True
    reused: bool = False
