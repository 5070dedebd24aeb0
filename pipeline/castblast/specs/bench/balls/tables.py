"""Tables of balls: CSV and other text, and what other engines write, with faults by line."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from castblast.errors import SpecError
from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.bench.given import initial_state
from castblast.specs.bench.balls.engines import engine_sheets
from castblast.specs.bench.balls.spec import RADII
from castblast.specs.quantity import QuantityIn
from castblast.specs.tables.table import Form, Table, table_of
from castblast.specs.tables.text import open_sheet, read_lines
from castblast.types import FloatArray, IntArray

#: Bounds of radii, places and velocities, in whatever file they stand.
RADIUS = QuantityIn("m", *RADII)
PLACE = QuantityIn("m", -1e5, 1e5)
VELOCITY = QuantityIn("m s-1", -500.0, 500.0)

_PLACE, _MOTION, _SPIN = ("x", "y", "z"), ("vx", "vy", "vz"), ("wx", "wy", "wz")
_MOST_LINES = 20
_FORM = Form(
    columns={
        **dict.fromkeys(_PLACE, PLACE),
        "radius": RADIUS,
        "diameter": QuantityIn("m", 2.0 * RADII[0], 2.0 * RADII[1]),
        **dict.fromkeys(_MOTION, VELOCITY),
        **dict.fromkeys(_SPIN, QuantityIn("rad s-1", -1e5, 1e5)),
        "block": QuantityIn("1", -1.0, 1e7),
    },
    required=_PLACE,
    # As ParaView writes the points of a file, and engines unwrapped places and spins.
    aliases={
        "r": "radius",
        **{f"points_{k}": name for k, name in enumerate(_PLACE)},
        **{f"{name}u": name for name in _PLACE},
        **{f"omega{axis}": f"w{axis}" for axis in "xyz"},
    },
    ids=("id", "particle_id"),
    unique_ids=True,
    bare=True,
)
_FORMS = (
    "balls are read from CSV and other tables (x, y, z, radius), .npz, dump and data files of "
    "LAMMPS, and extended XYZ"
)


class BallTable(NamedTuple):
    """Balls as a table gives them, n of them.

    Attributes
    ----------
    table : Table
        Lines and ids.
    place : array (n, 3) [m]
    radius : array (n,) [m]
    velocity : array (n, 3) [m s-1], or None
    spin : array (n, 3) [rad s-1], or None
    block : array (n,), or None
    """

    table: Table
    place: FloatArray
    radius: FloatArray
    velocity: FloatArray | None
    spin: FloatArray | None
    block: IntArray | None


def read_ball_table(path: Path) -> BallTable:
    """Read a text file of balls.

    Balls of another engine come in the order of their ids, those of a table in its own.

    Raises
    ------
    SpecError
        One line per fault, see `files.read_balls`.
    """
    try:
        lines = read_lines(path)
    except SpecError as fault:
        raise SpecError(f"{fault}; {_FORMS}" if path.is_file() else str(fault)) from None
    sheets = engine_sheets(path, lines)
    if not sheets:
        return _balls_of(table_of(path, open_sheet(path, lines), _FORM))
    balls = _sorted(table_of(path, sheets[0], replace(_FORM, loose=True)))
    if len(sheets) > 1:
        motion = {name: _FORM.columns[name] for name in (*_MOTION, *_SPIN)}
        form = Form(motion, _MOTION, ids=("id",), unique_ids=True, bare=True)
        moving = _sorted(table_of(path, sheets[1], form))
        if moving.label != balls.label:
            raise SpecError(f"{path}: the balls of 'Atoms' and of 'Velocities' are not the same")
        balls = replace(balls, number=moving.number | balls.number)
    return _balls_of(balls)


def balls_at(found: BallTable, law: ContactLaw | None) -> Particles:
    """Make the state of balls, and refuse one that cannot be simulated; faults name lines."""
    _require_single(found)
    balls, faults = initial_state(
        found.place,
        found.radius,
        velocity=found.velocity,
        spin=found.spin,
        block=found.block,
        law=law,
    )
    if faults:
        path, lines = found.table.path, found.table.line
        raise SpecError("\n".join(f"{path}: {_with_lines(fault, lines)}" for fault in faults))
    return balls


def _sorted(table: Table) -> Table:
    """Rows in the order of their ids."""
    if not table.label:
        return table
    wrong = [k for k, label in enumerate(table.label) if not label.isdecimal() or len(label) > 18]
    if wrong:
        raise SpecError(f"{table.where(wrong[0])}: id: a whole number is needed")
    order = np.argsort(np.array(table.label, dtype=np.int64), kind="stable")
    return replace(
        table,
        line=table.line[order],
        number={name: column[order] for name, column in table.number.items()},
        label=[table.label[k] for k in order],
        text={},
    )


def _balls_of(table: Table) -> BallTable:
    """Columns of balls; what is missing or empty is told by line."""
    path, number = table.path, table.number
    groups = [[name for name in group if name in number] for group in (_MOTION, _SPIN)]
    faults = [
        f"{path}: the column '{name}' is missing"
        for given, group in zip(groups, (_MOTION, _SPIN), strict=True)
        for name in group
        if given and name not in given
    ]
    sizes = [name for name in ("radius", "diameter") if name in number]
    if not sizes:
        faults.append(f"{path}: the column 'radius' is missing")
    for name in (*sizes, *groups[0], *groups[1], *(["block"] if "block" in number else [])):
        bad = np.flatnonzero(~np.isfinite(number[name]))
        faults += [f"{table.where(row)}: {name}: empty: a number is needed" for row in bad[:5]]
    if faults:
        raise SpecError("\n".join(faults))
    radius = number["radius"] if "radius" in number else 0.5 * number["diameter"]
    if len(sizes) == 2 and not np.allclose(2.0 * radius, number["diameter"], rtol=1e-5):
        row = int(np.argmax(~np.isclose(2.0 * radius, number["diameter"], rtol=1e-5)))
        raise SpecError(f"{table.where(row)}: the diameter is not twice the radius")
    return BallTable(
        table=table,
        place=_columns(table, _PLACE),
        radius=radius,
        velocity=_columns(table, _MOTION) if groups[0] else None,
        spin=_columns(table, _SPIN) if groups[1] else None,
        block=number["block"].astype(np.int64) if "block" in number else None,
    )


def _columns(table: Table, names: tuple[str, ...]) -> FloatArray:
    return np.column_stack([table.number[name] for name in names])


def _require_single(found: BallTable) -> None:
    """Refuse balls that stand in the table twice."""
    order = np.lexsort(found.place.T)
    same = np.flatnonzero((np.diff(found.place[order], axis=0) == 0.0).all(axis=1))
    if len(same):
        line = found.table.line
        pairs = sorted(sorted((int(line[order[k]]), int(line[order[k + 1]]))) for k in same)
        raise SpecError(
            "\n".join(
                f"{found.table.path}: lines {one} and {two}: two balls at one place"
                for one, two in pairs[:_MOST_LINES]
            )
        )


def _with_lines(fault: str, line: IntArray) -> str:
    """Name the line of each ball that a fault names by its number."""

    def named(match: re.Match[str]) -> str:
        return f"{match[1]}{match[2]} (line {line[int(match[2])]})"

    return re.sub(r"(\bballs? |\band (?=\d+ by))(\d+)", named, fault)
