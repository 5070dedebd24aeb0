"""Where a bench lies in the grid of the mine: files in that grid are turned into its own frame."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np

from castblast.muckpile.bench.geometry import Bench
from castblast.specs.loading import Spec
from castblast.specs.quantity import QuantityIn
from castblast.types import FloatArray

#: Of the directions of a pattern that are tried [rad].
_STEP = math.radians(0.1)
#: A pattern fits a bench that is by this share too small; corners are seldom surveyed better.
_FIT = 1.02


#: A place in any grid on the ground; bench files and columns of tables.
GRID_PLACE = QuantityIn("m", -1e8, 1e8)


class FrameSpec(Spec):
    """Place and direction of a bench in a grid.

    Attributes
    ----------
    easting, northing : float [m]
        Of the origin of the bench: the toe of the free face at the end where y = 0.
    bearing : float [rad]
        Of the throw, the x axis of the bench, clockwise from north. The y axis points to the left
        of it.
    """

    easting: Annotated[float, GRID_PLACE]
    northing: Annotated[float, GRID_PLACE]
    bearing: Annotated[float, QuantityIn("rad", 0.0, 2.0 * math.pi)] = 0.5 * math.pi

    def to_bench(self, place: FloatArray) -> FloatArray:
        """Turn eastings and northings (n, 2) [m] into x and y of the bench."""
        origin = np.array([self.easting, self.northing])
        return np.asarray((place - origin) @ _axes(self.bearing))

    def words(self) -> str:
        """Line of a bench file."""
        return (
            f"frame: {{easting: {self.easting:.2f} m, northing: {self.northing:.2f} m, "
            f"bearing: {math.degrees(self.bearing):.1f} deg}}"
        )


def _axes(bearing: float) -> FloatArray:
    """Columns: the axes x and y of a bench, in easting and northing."""
    sine, cosine = math.sin(bearing), math.cos(bearing)
    return np.array([[sine, -cosine], [cosine, sine]])


def suggest_frame(place: FloatArray, delay: FloatArray, bench: Bench) -> FrameSpec | None:
    """Find the frame in which a pattern lies in the middle of its bench.

    Parameters
    ----------
    place : array (n, 2) [m]
    delay : array (n,) [s]
        The front row fires first.
    bench : Bench

    Returns
    -------
    FrameSpec or None
        None: the pattern is larger than the bench, whichever way it is turned.
    """
    middle = place.mean(axis=0)
    centred = place - middle
    angles = np.arange(0.0, 0.5 * math.pi, _STEP)
    areas = [float(np.prod(np.ptp(centred @ _axes(angle), axis=0))) for angle in angles]
    along = float(angles[int(np.argmin(areas))])
    best, latest = None, -math.inf
    for quarter in range(4):
        bearing = (along + 0.5 * math.pi * quarter) % (2.0 * math.pi)
        local = centred @ _axes(bearing)
        size = np.ptp(local, axis=0)
        if size[0] > _FIT * bench.width or size[1] > _FIT * bench.length:
            continue
        # The further from the face, the later.
        behind = float(-(local[:, 0] - local[:, 0].mean()) @ (delay - delay.mean()))
        if behind > latest:
            box = 0.5 * (local.max(axis=0) + local.min(axis=0))
            centre = np.array([-0.5 * bench.width, 0.5 * bench.length])
            origin = middle + _axes(bearing) @ (box - centre)
            best, latest = (bearing, origin), behind
    if best is None:
        return None
    bearing, origin = best
    # As it will be written into a bench file.
    return FrameSpec.model_validate(
        {
            "easting": f"{origin[0]:.2f} m",
            "northing": f"{origin[1]:.2f} m",
            "bearing": f"{math.degrees(bearing):.1f} deg",
        }
    )
