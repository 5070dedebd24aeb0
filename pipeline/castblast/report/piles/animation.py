"""Animation of a cast: the scene from above and aside, and a section below it, over time.

States are spooled to a file as they come (12 bytes a ball and frame), so that the picture can be
framed by where the pile ends, and painted when the run is over. A gif is written
frame by frame with Pillow, an mp4 by ffmpeg through matplotlib, where it is installed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from castblast.disk.files import write_with
from castblast.errors import OutputError, SpecError
from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.bench.geometry import Bench
from castblast.report.piles.ball_picture import SECTION, Canvas
from castblast.report.piles.bench_lines import draw_bench_section
from castblast.report.piles.blocks import block_colours, origin_blocks, shown_range
from castblast.report.piles.ground import draw_ground_line
from castblast.report.piles.muckpile_view import Scene
from castblast.report.style import in_style, new_figure

if TYPE_CHECKING:
    from castblast.muckpile.ground.walls import Walls

FORMATS = ("gif", "mp4")
_WIDTH, _DPI = 8.0, 90
_COLOURS = 96
_LAST_FRAME = 1.5  # seconds that the end of a gif stands still
_FASTEST = 30.0
_SPOOL = ".positions"


def need_format(name: str) -> None:
    """Refuse an animation format that is unknown, or mp4 without ffmpeg.

    Raises
    ------
    SpecError
        What is allowed, or what to install.
    """
    if name not in FORMATS:
        message = f"--animation: {name}: unknown format; allowed: {', '.join(FORMATS)}"
        raise SpecError(message)
    if name == "mp4":
        from matplotlib.animation import FFMpegWriter

        if not FFMpegWriter.isAvailable():
            message = "--animation: mp4: needs the program ffmpeg, which was not found; use gif"
            raise SpecError(message)


class Animation:
    """States of a run as they come, painted at the end.

    Parameters
    ----------
    folder : path
        Of the spooled states, in a hidden file.
    start : Particles
    bench : Bench
    walls : Walls
        Ground.
    """

    def __init__(self, folder: Path, start: Particles, bench: Bench, walls: Walls) -> None:
        self._start, self._bench, self._walls = start, bench, walls
        self._colours = block_colours(origin_blocks(start, bench), bench)
        self._path = folder / _SPOOL
        self._file: IO[bytes] | None = None
        self.times: list[float] = []

    @property
    def _spool(self) -> IO[bytes]:
        if self._file is None:
            self._file = self._path.open("w+b")
        return self._file

    def add(self, time: float, balls: Particles) -> None:
        """Keep the state at `time` [s]."""
        try:
            self._spool.write(balls.position.astype(np.float32).tobytes())
            self._spool.flush()
        except OSError as fault:
            raise OutputError(f"{self._path}: cannot be written: {fault.strerror}") from None
        self.times.append(time)

    def resume(self, times: Sequence[float]) -> None:
        """Go on after the states at `times` [s] that an earlier process has spooled.

        Raises
        ------
        SpecError
            They are not there.
        """
        size = len(times) * self._start.position.size * np.dtype(np.float32).itemsize
        if not self._path.is_file() or self._path.stat().st_size < size:
            message = f"{self._path}: the frames of the run that was stopped are gone"
            raise SpecError(message)
        self._file = self._path.open("r+b")
        self._file.truncate(size)
        self._file.seek(size)
        self.times = list(times)

    def close(self) -> None:
        """Let go of the spooled states; they stay, hidden, in the folder."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def write(self, path: Path) -> Path:
        """Paint all states and write them as gif or mp4, by the suffix of `path`."""
        return write_with(path, self._write_mp4 if path.suffix == ".mp4" else self._write_gif)

    def _states(self) -> Iterator[Particles]:
        count = self._start.position.size
        self._spool.seek(0)
        for _ in self.times:
            place = np.frombuffer(self._spool.read(4 * count), dtype=np.float32)
            yield self._start._replace(position=place.reshape(-1, 3).astype(np.float64))

    def _rate(self) -> float:
        """Frames per second at which time runs as in nature, or slower."""
        steps = np.diff(self.times)
        return float(min(_FASTEST, 1.0 / np.median(steps))) if len(steps) else 1.0

    def _write_gif(self, path: Path) -> None:
        frames = self._images()
        first = next(frames)
        each = round(1000.0 / self._rate())
        duration = [each] * len(self.times)
        duration[-1] = max(each, round(1000.0 * _LAST_FRAME))
        first.save(
            path, save_all=True, append_images=frames, duration=duration, loop=0, optimize=False
        )

    def _images(self) -> Iterator[Any]:
        from PIL import Image

        palette = None
        for figure in self._figures():
            image = Image.fromarray(_pixels(figure))
            if palette is None:
                palette = image.quantize(_COLOURS, method=Image.Quantize.MEDIANCUT)
            yield image.quantize(palette=palette, dither=Image.Dither.NONE)

    def _write_mp4(self, path: Path) -> None:
        from matplotlib.animation import FFMpegWriter

        frames = self._figures()
        writer = FFMpegWriter(fps=round(self._rate()), extra_args=["-pix_fmt", "yuv420p"])
        figure = next(frames)
        with writer.saving(figure, str(path), _DPI):
            writer.grab_frame()
            for _ in frames:
                writer.grab_frame()

    def _figures(self) -> Iterator[Any]:
        """One figure, drawn anew for every state."""
        last = deque(self._states(), maxlen=1).pop()
        x, y = shown_range(self._start, last, 0), shown_range(self._start, last, 1)
        scene = Scene(x, y, self._bench, self._walls, pixels=round(_WIDTH * _DPI))
        top = 1.25 * max(self._bench.height, float(last.position[:, 2].max()))
        limits = (x[0], x[1], -0.04 * top, top)
        left, right, bottom, upper = scene.extent
        heights = [(upper - bottom) / (right - left), (limits[3] - limits[2]) / (x[1] - x[0])]
        size = round(_WIDTH * sum(heights) + 0.9, 1)
        figure, axes = new_figure(2, 1, width=_WIDTH, height=size, height_ratios=heights)
        figure.set_dpi(_DPI)
        for time, balls in zip(self.times, self._states(), strict=True):
            for axis in axes:
                axis.clear()
            scene.canvas(balls, self._colours).show(axes[0])
            self._draw_section(axes[1], balls, limits)
            _name_axes(axes, time)
            yield figure

    def _draw_section(
        self, axes: Any, balls: Particles, limits: tuple[float, float, float, float]
    ) -> None:
        bench = self._bench
        middle = 0.5 * bench.length
        behind = balls.position[:, 1] - middle
        seen = (behind >= 0.0) & (behind < bench.spacing)
        if not seen.any():
            seen = np.ones(len(behind), dtype=np.bool_)
        canvas = Canvas(SECTION, limits, round(_WIDTH * _DPI))
        canvas.add(balls.position[seen], balls.radius[seen], self._colours[seen])
        draw_ground_line(axes, self._walls, middle, limits[0], limits[1], limits[2])
        canvas.show(axes)
        draw_bench_section(axes, bench, middle)


@in_style
def _name_axes(axes: Any, time: float) -> None:
    axes[0].set_axis_off()
    axes[0].set_title(f"t = {time:.2f} s")
    axes[1].set(xlabel="x [m], section in the middle of the bench", ylabel="z [m]")


def _pixels(figure: Any) -> NDArray[np.uint8]:
    """Picture (rows, columns, 3) of a figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[:, :, :3].copy()
