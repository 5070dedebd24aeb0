"""A bench to blast: from a file, a mapping or keywords, drawn in plan."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from castblast.api.shared.frames import frame, library
from castblast.api.shared.markup import box, table
from castblast.disk.resources import find_spec
from castblast.extras import is_installed
from castblast.muckpile.bench.geometry import block_centres
from castblast.scene.plan import Plan, make_plan
from castblast.specs.bench.bench import BenchSpec
from castblast.specs.bench.bench import load_bench as read_bench
from castblast.specs.loading import make_spec
from castblast.specs.units import numbers_in_si
from castblast.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


class Bench:
    """A bench with its blocks and firing plan; see the bench files of castblast for all keys.

    Parameters
    ----------
    content : mapping, optional
        What a bench file holds: `name`, `bench`, `firing`, `velocity` or `surrogate`, `balls`, ...
        Texts carry their unit, numbers are in SI.
    folder : str or path
        Where files that it names lie.
    **keywords
        The same by keywords, beside or instead of `content`.

    Raises
    ------
    SpecError
        One line for every fault.

    Examples
    --------
    >>> import castblast as cb
    >>> bench = cb.Bench(
    ...     name="small",
    ...     bench={"length": "12 m", "width": 9.0, "height": "10 m"},
    ...     firing={"pattern": "row", "delay": "50 ms"},
    ...     velocity="12 m/s",
    ...     balls={"count": 500},
    ... )
    >>> bench
    <Bench small: 12 x 9 x 10 m, 12 blocks, 12 m/s>
    >>> bench.blocks["delay"].unique().tolist()
    [0.0, 0.05, 0.1]
    """

    def __init__(
        self,
        content: Mapping[str, Any] | None = None,
        /,
        *,
        folder: str | Path = ".",
        **keywords: Any,
    ) -> None:
        self._folder = Path(folder)
        with numbers_in_si():
            whole = {**(content or {}), **keywords}
            self._spec = make_spec(whole, BenchSpec, "Bench", folder=self._folder)

    @classmethod
    def of(cls, spec: BenchSpec, folder: Path) -> Bench:
        """Bench of a spec that has been read."""
        made = cls.__new__(cls)
        made._spec, made._folder = spec, folder
        return made

    @property
    def name(self) -> str:
        """Name of the bench."""
        return self._spec.name

    @property
    def spec(self) -> BenchSpec:
        """Content of the bench file, in SI."""
        return self._spec

    @property
    def folder(self) -> Path:
        """Where the files lie that the bench names."""
        return self._folder

    @cached_property
    def plan(self) -> Plan:
        """Firing of the blocks: delays and velocities.

        Raises
        ------
        SpecError
            Faults of the file of holes, or a design that the surrogate cannot take.
        """
        return make_plan(self._spec, self._spec.bench.to_bench(), self._folder)

    @property
    def blocks(self) -> pd.DataFrame:
        """Blocks or holes: place `x`, `y` [m], `delay` [s] (inf: never), `speed` [m s-1]."""
        place, plan = self._places(), self.plan
        made = frame(
            {
                "x": list(place[:, 0]),
                "y": list(place[:, 1]),
                "delay": list(plan.delay),
                "speed": list(np.linalg.norm(plan.velocity, axis=1)),
            },
            range(len(place)),
            "block",
            "Bench.blocks",
        )
        made.attrs["units"] = {"x": "m", "y": "m", "delay": "s", "speed": "m s-1"}
        return made

    def plot(self) -> Figure:
        """Draw the bench in plan: faces, blocks, firing times, directions; writes nothing."""
        library("matplotlib", "Bench.plot")
        from castblast.report.piles.bench_plan import bench_figure

        plan, geometry = self.plan, self._spec.bench.to_bench()
        return bench_figure(self._title(), geometry, self._places(), plan.delay, plan.velocity)

    def _places(self) -> FloatArray:
        """Middle (b, 2) [m] of every block, or its hole."""
        holes = self.plan.holes
        if holes is not None:
            return np.asarray(holes)[:, :2]
        return block_centres(self._spec.bench.to_bench())[:, :2]

    def _title(self) -> str:
        bench, plan = self._spec.bench.to_bench(), self.plan
        size = f"{bench.length:g} x {bench.width:g} x {bench.height:g} m"
        return f"{self.name}: {size}, {len(plan.delay)} blocks, {plan.speed:.3g} m/s"

    def __repr__(self) -> str:
        return f"<Bench {self._title()}>"

    def _repr_html_(self) -> str:
        bench = self._spec.bench.to_bench()
        rows = [
            ("length", f"{bench.length:g} m"),
            ("width", f"{bench.width:g} m"),
            ("height", f"{bench.height:g} m"),
            ("burden", f"{bench.burden:g} m"),
            ("spacing", f"{bench.spacing:g} m"),
            ("firing", self._spec.firing.pattern),
            ("velocity", f"{self.plan.speed:.3g} m/s"),
        ]
        parts = [table(("bench", ""), rows)]
        if is_installed("matplotlib"):
            from castblast.report.style import figure_png

            parts.append(picture(figure_png(self.plot(), dpi=80), "plan of the bench"))
        return box(self._title(), *parts)


def load_bench(bench: str | Path | Mapping[str, Any]) -> Bench:
    """Read a bench that comes with castblast, a file of your own, or a mapping of the same content.

    Parameters
    ----------
    bench : str, path or mapping

    Raises
    ------
    SpecError
        One line for every fault; an unknown name, with the nearest.

    Examples
    --------
    >>> import castblast as cb
    >>> cb.load_bench("demo").blocks.shape[1]
    4
    """
    if isinstance(bench, Mapping):
        return Bench(bench)
    path = find_spec(bench, "bench")
    return Bench.of(read_bench(path), path.parent)


def picture(content: bytes, words: str) -> str:
    """PNG inside HTML, on white, so that its black lines are seen on dark pages too."""
    data = base64.b64encode(content).decode("ascii")
    style = "max-width:100%;height:auto;background:#fff"
    return f'<img alt="{words}" style="{style}" src="data:image/png;base64,{data}"/>'
