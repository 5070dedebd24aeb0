"""What a muckpile run writes on request: ore through the blast, an animation, ParaView files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from castblast.errors import SpecError
from castblast.muckpile.bench.geometry import Bench
from castblast.muckpile.results.ore import DigPlan, OrePolygon
from castblast.scene.bounds import FRAME_BYTES, FrameOrder
from castblast.specs.bench.frame import FrameSpec
from castblast.specs.bench.ore import read_ore
from castblast.specs.quantity import parse_quantity
from castblast.stages.muckpile.frames import FRAME_INTERVAL, check_frames

#: Side [m] below which a dig block means nothing to a loader.
_SMALLEST_DIG_BLOCK = 0.01


class Extras(NamedTuple):
    """Wishes as written by people; texts carry their unit, numbers are SI.

    Attributes
    ----------
    ore : path, optional
        File of ore polygons; instead of that of the bench file.
    dig_block : str or float [m], optional
        Side of a dig block; default: the spacing of the bench.
    flitch : str or float [m], optional
        Height of a dig block; default: that of the pile.
    animation : "gif", "mp4" or None
    vtk, vtkhdf : bool
        Series of .vtp with .pvd; one .vtkhdf.
    frame_interval : str or float [s]
        Simulated time between two frames of all three.
    """

    ore: Path | None = None
    dig_block: str | float | None = None
    flitch: str | float | None = None
    animation: str | None = None
    vtk: bool = False
    vtkhdf: bool = False
    frame_interval: str | float = FRAME_INTERVAL

    @property
    def frames(self) -> bool:
        """Whether states along the way are wanted."""
        return self.animation is not None or self.vtk or self.vtkhdf

    def order(self, interval: float) -> FrameOrder | None:
        """Frames every `interval` [s] and what they take on disk; None: none are wanted."""
        wanted = {"animation": self.animation is not None, "vtk": self.vtk, "vtkhdf": self.vtkhdf}
        size = sum(FRAME_BYTES[name] for name, is_wanted in wanted.items() if is_wanted)
        return FrameOrder(interval, size) if self.frames else None


class ReadExtras(NamedTuple):
    """Wishes, checked."""

    ore: Sequence[OrePolygon]
    plan: DigPlan
    interval: float


def read_extras(
    extras: Extras, bench: Bench, ore_of_bench: Path | None, frame: FrameSpec | None = None
) -> ReadExtras:
    """Check the wishes before anything is simulated.

    Parameters
    ----------
    extras : Extras
    bench : Bench
    ore_of_bench : path, optional
        File of ore that the bench file names.
    frame : FrameSpec, optional
        Of the bench in the grid of the mine, in which the ore is given then.

    Raises
    ------
    SpecError
        Faults of the file of ore, lengths without unit, formats that cannot be written here.
    """
    check_frames(extras.animation, vtk=extras.vtk, vtkhdf=extras.vtkhdf)
    path = extras.ore or ore_of_bench
    plan = DigPlan(block=bench.spacing)
    if extras.dig_block is not None:
        block = _positive(extras.dig_block, "m", "--dig-block", _SMALLEST_DIG_BLOCK)
        plan = plan._replace(block=block)
    if extras.flitch is not None:
        flitch = _positive(extras.flitch, "m", "--flitch", _SMALLEST_DIG_BLOCK)
        plan = plan._replace(flitch=flitch)
    interval = _positive(extras.frame_interval, "s", "--frame-interval")
    return ReadExtras(() if path is None else read_ore(path, bench, frame), plan, interval)


def _positive(value: str | float, unit: str, where: str, least: float = 0.0) -> float:
    number = parse_quantity(value, unit, where) if isinstance(value, str) else value
    if not 0.0 < number < float("inf"):
        raise SpecError(f"{where}: {value}: must be larger than 0 {unit}")
    if number < least:
        raise SpecError(f"{where}: {value}: allowed: at least {least:g} {unit}")
    return number
