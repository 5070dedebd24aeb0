"""The same cast for another engine: input of LAMMPS or LIGGGHTS instead of a run."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import NamedTuple

from castblast.api.muckpile.document import HEADER
from castblast.disk.files import written_together
from castblast.export.engines.lammps_deck import write_lammps_deck
from castblast.export.engines.liggghts_deck import write_liggghts_deck
from castblast.muckpile.cast.solver import CastCase
from castblast.specs.bench.bench import BenchSpec
from castblast.stages.outcome import Outcome


class Decks(NamedTuple):
    """Folders for the decks that are wanted."""

    lammps: Path | None = None
    liggghts: Path | None = None

    @property
    def wanted(self) -> bool:
        """Whether there is one."""
        return self.lammps is not None or self.liggghts is not None


def write_decks(spec: BenchSpec, case: CastCase, decks: Decks) -> Outcome:
    """Write the input of other engines for exactly the case that would be run.

    Raises
    ------
    SpecError
        One line per thing that an engine cannot take.
    """
    files: list[Path] = []
    for folder, write in (
        (decks.lammps, write_lammps_deck),
        (decks.liggghts, write_liggghts_deck),
    ):
        if folder is not None:
            files += written_together(folder, partial(write, case=case))
    balls = len(case.particles.radius)
    rows = [
        (f"run {engine} with", f"cd {folder} && mpirun -np 8 {program} -in cast.in", "")
        for engine, folder, program in (
            ("LAMMPS", decks.lammps, "lmp"),
            ("LIGGGHTS", decks.liggghts, "liggghts"),
        )
        if folder is not None
    ]
    document = {"bench": spec.name, "balls": balls, "files": [str(path) for path in files]}
    title = f"{spec.name}: {balls:,} balls, packed and not thrown"
    return Outcome(document=document, title=title, header=HEADER, rows=rows, files=files)
