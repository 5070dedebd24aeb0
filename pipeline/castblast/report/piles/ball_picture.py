"""Balls painted as shaded spheres into a raster, seen along parallel lines.

A picture of a muckpile shows up to millions of balls, most of them hidden. Drawing each as a
vector circle takes minutes and gigabytes; a depth buffer takes a fraction of a second, so that no
ball has to be left out. Matplotlib places the raster in its axes.
"""

from __future__ import annotations

from math import cos, sin
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from castblast.kernel import kernel
from castblast.types import FloatArray

# Light from the upper left, over the shoulder of the viewer: right, up, towards the viewer.
_LIGHT = np.array([-0.45, 0.55, 0.70])
_AMBIENT = 0.5
_FINER = 2  # pixels are averaged over squares of this side


class View(NamedTuple):
    """Parallel view: unit vectors of the picture in space, rows right, up, towards the viewer."""

    axes: FloatArray

    def project(self, position: FloatArray) -> FloatArray:
        """Picture coordinates (n, 3) [m] of points (n, 3): right, up, towards the viewer."""
        return np.ascontiguousarray(position @ self.axes.T)


#: From above, x to the right and y up; from above, y to the right and x down; from the end of the
#: bench at low y, x to the right and z up. None of them is mirrored.
PLAN_X = View(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
PLAN_Y = View(np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
SECTION = View(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]))


def oblique(azimuth: float, elevation: float) -> View:
    """View from above and aside.

    Parameters
    ----------
    azimuth : float [rad]
        0: from the end of the bench at low y, with the throw to the right; positive: the viewer
        walks towards the front of the throw.
    elevation : float [rad]
        Of the viewer over the horizontal.
    """
    right = np.array([cos(azimuth), sin(azimuth), 0.0])
    level = np.array([sin(azimuth), -cos(azimuth), 0.0])
    towards = cos(elevation) * level + np.array([0.0, 0.0, sin(elevation)])
    return View(np.stack([right, np.cross(towards, right), towards]))


class Canvas:
    """A raster over a rectangle of a view, nearest surfaces on top.

    Parameters
    ----------
    view : View
    extent : (left, right, bottom, top) [m]
        In picture coordinates.
    pixels : int
        Along the width; the height follows.
    """

    def __init__(
        self, view: View, extent: tuple[float, float, float, float], pixels: int = 1400
    ) -> None:
        left, right, bottom, top = extent
        self.view, self.extent = view, extent
        self._scale = _FINER * pixels / (right - left)
        rows = max(1, round(pixels * (top - bottom) / (right - left)))
        shape = (_FINER * rows, _FINER * pixels)
        self._depth = np.full(shape, -np.inf)
        self._colour = np.zeros((*shape, 3), dtype=np.float32)

    def add(
        self, position: FloatArray, radius: FloatArray, colours: FloatArray, *, flat: bool = False
    ) -> None:
        """Paint balls.

        Parameters
        ----------
        position, radius : array (n, 3), (n,) [m]
        colours : array (n, 3 or 4)
        flat : bool
            Without shading, for marks and ground.
        """
        place = self.view.project(np.asarray(position, dtype=np.float64))
        place[:, 0] -= self.extent[0]
        place[:, 1] -= self.extent[2]
        _paint(
            place,
            np.ascontiguousarray(radius, dtype=np.float64),
            np.ascontiguousarray(colours[:, :3], dtype=np.float64),
            self._scale,
            1.0 if flat else _AMBIENT,
            _LIGHT / np.linalg.norm(_LIGHT),
            self._depth,
            self._colour,
        )

    def image(self) -> NDArray[np.uint8]:
        """Picture (rows, columns, 4), first row at the bottom; transparent where nothing is."""
        rows, columns = (size // _FINER for size in self._depth.shape)
        image = np.zeros((rows, columns, 4), dtype=np.uint8)
        _shrink(self._depth, self._colour, _FINER, image)
        return image

    def show(self, axes: Any, extent: tuple[float, float, float, float] | None = None) -> None:
        """Put the picture into matplotlib axes and give them its limits, to scale.

        `extent` names the edges as the axes count them; default: picture coordinates.
        """
        left, right, bottom, top = extent or self.extent
        axes.imshow(self.image(), extent=(left, right, bottom, top), origin="lower", zorder=1.5)
        axes.set(xlim=(left, right), ylim=(bottom, top))
        axes.set_aspect("equal")


@kernel
def _paint(
    place: FloatArray,
    radius: FloatArray,
    colour: FloatArray,
    scale: float,
    ambient: float,
    light: FloatArray,
    depth: FloatArray,
    picture: NDArray[np.float32],
) -> None:
    """Paint balls at `place` (n, 3), from the lower left corner, into depth and picture.

    Of two surfaces in the same place of a pixel the nearer stays; of equal ones the first.
    """
    rows, columns = depth.shape
    for n in range(len(radius)):
        u, v, w, r = place[n, 0] * scale, place[n, 1] * scale, place[n, 2] * scale, radius[n]
        reach = max(r * scale, 0.5)
        first_i, last_i = int(np.ceil(u - reach - 0.5)), int(np.floor(u + reach - 0.5))
        first_j, last_j = int(np.ceil(v - reach - 0.5)), int(np.floor(v + reach - 0.5))
        for j in range(max(first_j, 0), min(last_j, rows - 1) + 1):
            for i in range(max(first_i, 0), min(last_i, columns - 1) + 1):
                right, up = (i + 0.5 - u) / reach, (j + 0.5 - v) / reach
                square = right * right + up * up
                if square > 1.0:
                    continue
                bulge = np.sqrt(1.0 - square)
                near = w + bulge * reach
                if near <= depth[j, i]:
                    continue
                depth[j, i] = near
                lit = right * light[0] + up * light[1] + bulge * light[2]
                shade = ambient + (1.0 - ambient) * max(lit, 0.0)
                for c in range(3):
                    picture[j, i, c] = min(shade * colour[n, c], 1.0)


@kernel
def _shrink(
    depth: FloatArray, picture: NDArray[np.float32], finer: int, image: NDArray[np.uint8]
) -> None:
    """Average squares of `finer` pixels a side into colour and cover."""
    rows, columns, _ = image.shape
    for j in range(rows):
        for i in range(columns):
            covered = 0
            red, green, blue = 0.0, 0.0, 0.0
            for n in range(j * finer, (j + 1) * finer):
                for m in range(i * finer, (i + 1) * finer):
                    if depth[n, m] > -np.inf:
                        covered += 1
                        red += picture[n, m, 0]
                        green += picture[n, m, 1]
                        blue += picture[n, m, 2]
            if covered:
                image[j, i, 0] = np.uint8(255.0 * red / covered + 0.5)
                image[j, i, 1] = np.uint8(255.0 * green / covered + 0.5)
                image[j, i, 2] = np.uint8(255.0 * blue / covered + 0.5)
                image[j, i, 3] = np.uint8(255.0 * covered / (finer * finer) + 0.5)
