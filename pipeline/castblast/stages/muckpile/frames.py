"""States of a cast along the way: animation and files for ParaView."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from castblast.errors import SpecError
from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.bench.geometry import Bench
from castblast.muckpile.cast.case import CastCase
from castblast.report.piles.animation import Animation, need_format
from castblast.report.piles.vtk_files import VtkSeries, need_vtk, write_vtkhdf

#: Simulated time [s] between two states by default.
FRAME_INTERVAL = 0.1
_FOLDER, _HIDDEN = "frames", ".frames"
#: Names under which the frames taken so far stand in a restart file.
_TIMES, _KINDS = "frames.time", "frames.kinds"


def check_frames(animation: str | None, *, vtk: bool, vtkhdf: bool) -> None:
    """Refuse what cannot be written here, before anything is computed.

    Raises
    ------
    SpecError
        Unknown format, mp4 without ffmpeg, or VTK missing.
    """
    if animation is not None:
        need_format(animation)
    for option, wanted in (("--vtk", vtk), ("--vtkhdf", vtkhdf)):
        if wanted:
            need_vtk(option)


class Frames:
    """Takes the states of a run; an instance is the snapshot callback of `run_cast`.

    Together with a restart file and what lies in `folder`, a stopped run goes on with them.

    Parameters
    ----------
    folder : path
        Where results are made: ``animation.gif`` (or mp4), ``frames/balls_*.vtp`` and
        ``balls.pvd``, ``balls.vtkhdf``.
    case : CastCase
        Give it a `snapshot_interval`.
    bench : Bench
    animation : "gif", "mp4" or None
    vtk, vtkhdf : bool
    """

    def __init__(
        self,
        folder: Path,
        case: CastCase,
        bench: Bench,
        *,
        animation: str | None = None,
        vtk: bool = False,
        vtkhdf: bool = False,
    ) -> None:
        check_frames(animation, vtk=vtk, vtkhdf=vtkhdf)
        self._folder, self._format = folder, animation
        self._vtk, self._vtkhdf = vtk, vtkhdf
        self._film: Animation | None = None
        self._series: VtkSeries | None = None
        folder.mkdir(parents=True, exist_ok=True)
        if animation:
            self._film = Animation(folder, case.particles, bench, case.walls)
        if vtk or vtkhdf:
            self._series = VtkSeries(folder / (_FOLDER if vtk else _HIDDEN))

    def __bool__(self) -> bool:
        """Whether anything is wanted."""
        return self._film is not None or self._series is not None

    def __call__(self, time: float, balls: Particles) -> None:
        """Take the state at `time` [s]; a state at the same time again is left out."""
        if self._film is not None and (not self._film.times or time > self._film.times[-1]):
            self._film.add(time, balls)
        if self._series is not None and (not self._series.times or time > self._series.times[-1]):
            self._series.add(time, balls)

    @property
    def _kinds(self) -> str:
        wanted = {"animation": bool(self._format), "vtk": self._vtk, "vtkhdf": self._vtkhdf}
        return " ".join(name for name, is_wanted in wanted.items() if is_wanted)

    def save(self) -> dict[str, NDArray[Any]]:
        """What belongs to the state of the run: times of the frames taken, and their kinds."""
        taken = self._film or self._series
        times = taken.times if taken is not None else []
        return {_TIMES: np.array(times, dtype=np.float64), _KINDS: np.array(self._kinds)}

    def resume(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go on after the frames of a stopped run.

        Raises
        ------
        SpecError
            It took none, or of other kinds, or they are gone.
        """
        kinds = str(arrays.get(_KINDS, ""))
        if kinds != self._kinds:
            message = (
                f"{self._folder.parent}: the stopped run kept other frames "
                f"({kinds or 'none'}) than are requested now ({self._kinds}); give the same "
                f"options, or remove its restart file to start from the beginning"
            )
            raise SpecError(message)
        for taker in (self._film, self._series):
            if taker is not None:
                taker.resume(arrays[_TIMES].tolist())

    def close(self) -> list[Path]:
        """Write what is still open; return the files that matter to people.

        States stay in hidden files of the folder, so that writing can be repeated.
        """
        files: list[Path] = []
        if self._series is not None and self._series.times:
            if self._vtk:
                files.append(self._series.close())
            if self._vtkhdf:
                files.append(write_vtkhdf(self._folder / "balls.vtkhdf", self._series))
        if self._film is not None:
            if self._film.times:
                files.append(self._film.write(self._folder / f"animation.{self._format}"))
            self._film.close()
        return files
