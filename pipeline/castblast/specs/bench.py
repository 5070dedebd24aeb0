"""A bench to throw, as a file: geometry, blocks and firing plan, velocity, balls, contact law.

Everything that the discrete-element model needs except the surrogate that may give the velocity:
that is handed in by whoever runs the bench, since specs know no networks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from castblast.errors import SpecError, nearest_name
from castblast.muckpile.bench import (
    Bench,
    block_shape,
    check_bench,
    echelon_delays,
    row_delays,
    v_delays,
)
from castblast.muckpile.contact import ContactLaw, DashpotMode
from castblast.muckpile.packing import check_packing
from castblast.muckpile.particles import FloatArray
from castblast.resources import resource
from castblast.specs.loading import Spec, load_spec
from castblast.specs.quantity import QuantityError, QuantityIn, convert_variable
from castblast.variables import VARIABLES

_FOLDER = "data_specs/benches"
_RIGHT_ANGLE = math.pi / 2.0
_FROM_BENCH = ("burden", "spacing", "bench_height", "face_angle")

_Length = Annotated[float, QuantityIn("m", above=0.0, upper=2000.0)]


class BenchGeometry(Spec):
    """The bench and what stands around it; blocks are one burden by one spacing in plan."""

    length: _Length
    width: _Length
    height: _Length
    face_angle: Annotated[float, QuantityIn("rad", 0.1, _RIGHT_ANGLE + 1e-12)] = _RIGHT_ANGLE
    burden: _Length = 3.0
    spacing: _Length = 3.0
    rear: bool = True
    ends: Literal["open", "wall", "mirror"] = "open"

    def to_bench(self) -> Bench:
        """Geometry as the discrete-element model takes it."""
        return Bench(
            self.length,
            self.width,
            self.height,
            min(self.face_angle, _RIGHT_ANGLE),
            self.burden,
            self.spacing,
        )

    @model_validator(mode="after")
    def _possible(self) -> BenchGeometry:
        faults = check_bench(self.to_bench())
        for block, side in (("burden", "width"), ("spacing", "length")):
            size, room = getattr(self, block), getattr(self, side)
            if size > room:
                faults.append(f"{block} {size:g} m: the block is larger than the {side} {room:g} m")
        if faults:
            raise QuantityError("; ".join(faults))
        return self


class FiringPlan(Spec):
    """Order and delay of the blocks; with pattern ``none`` the balls are loose from the start."""

    pattern: Literal["echelon", "row", "v", "none"] = "echelon"
    delay: Annotated[float, QuantityIn("s", 0.0, 10.0)] = 0.030
    start: Annotated[float, QuantityIn("s", 0.0, 10.0)] = 0.0
    hold_unfired: bool = True

    def block_delay(self, bench: Bench) -> FloatArray:
        """Firing time [s] of each block, (rows * columns,); inf: never fired."""
        rows, columns = block_shape(bench)
        if self.pattern == "none":
            return np.full(rows * columns, np.inf)
        plans = {"echelon": echelon_delays, "row": row_delays, "v": v_delays}
        return plans[self.pattern](rows, columns, self.delay, self.start)


class BallsSpec(Spec):
    """Balls to pack (by mean radius or by number), or a file of balls.

    Attributes
    ----------
    mean_radius : float [m], optional
    count : int, optional
        About this many balls; their mean radius follows.
    file : str, optional
        ``.npz`` with x (n, 3) and r (n,) in m, relative to the bench file.
    relative_deviation : float [-]
        Radii are uniform in mean radius times 1 -+ this.
    solid_fraction : float [-]
    """

    mean_radius: Annotated[float, QuantityIn("m", 0.005, 10.0)] | None = None
    count: Annotated[int, Field(ge=10, le=5_000_000)] | None = None
    file: Annotated[str, Field(min_length=1)] | None = None
    relative_deviation: Annotated[float, QuantityIn("1", 0.0, 0.8)] = 0.5
    solid_fraction: Annotated[float, QuantityIn("1", 0.55, 0.63)] = 0.60

    @model_validator(mode="after")
    def _one_of_three(self) -> BallsSpec:
        if sum(x is not None for x in (self.mean_radius, self.count, self.file)) != 1:
            message = "exactly one of 'mean_radius', 'count' and 'file' is needed"
            raise QuantityError(message)
        return self


class ContactSpec(Spec):
    """Rolling-resistance linear law; stiffness and friction as in the paper, see data_specs.

    The paper states no damping; 0.2 with dashpot mode 3 (no tension, no shear dashpot while
    slipping) is that of the repose-angle example in the PFC manual.
    """

    effective_modulus: Annotated[float, QuantityIn("Pa", 1e4, 1e11)] = 1e7
    stiffness_ratio: Annotated[float, QuantityIn("1", 0.1, 10.0)] = 2.0
    friction: Annotated[float, QuantityIn("1", 0.0, 5.0)] = 0.5
    rolling_friction: Annotated[float, QuantityIn("1", 0.0, 5.0)] = 0.5
    damping: Annotated[float, QuantityIn("1", 0.0, 0.99)] = 0.2
    dashpot_mode: Annotated[int, Field(ge=0, le=3)] = 3
    density: Annotated[float, QuantityIn("kg m-3", 100.0, 20000.0)] = 2600.0

    def to_law(self) -> ContactLaw:
        """Law as the discrete-element model takes it."""
        return ContactLaw(
            effective_modulus=self.effective_modulus,
            stiffness_ratio=self.stiffness_ratio,
            friction=self.friction,
            rolling_friction=self.rolling_friction,
            damping_normal=self.damping,
            damping_shear=self.damping,
            dashpot_mode=DashpotMode(self.dashpot_mode),
            density=self.density,
        )


class SlopeSpec(Spec):
    """A plane that faces the bench, such as the side of an existing pile."""

    distance: Annotated[float, QuantityIn("m", 0.0, 2000.0)]
    angle: Annotated[float, QuantityIn("rad", 0.01, _RIGHT_ANGLE)] = math.radians(30.0)


class StopRule(Spec):
    """The end: translational energy below a share of its maximum for a while, or a longest time."""

    energy_ratio: Annotated[float, QuantityIn("1", 0.0, 0.5)] = 1e-4
    duration: Annotated[float, QuantityIn("s", 0.0, 10.0)] = 0.2
    longest_time: Annotated[float, QuantityIn("s", above=0.0, upper=600.0)] = 30.0


class Direction(Spec):
    """Direction of the throw: in plan from the normal of the face, and over the horizontal."""

    azimuth: Annotated[float, QuantityIn("rad", -_RIGHT_ANGLE, _RIGHT_ANGLE)] = 0.0
    elevation: Annotated[float, QuantityIn("rad", -_RIGHT_ANGLE, _RIGHT_ANGLE)] = 0.0


def _read_design(value: object) -> dict[str, Any]:
    """Explosive and variables of a design; all faults at once."""
    if not isinstance(value, Mapping):
        message = "a group of keys is needed: explosive, ucs, ..."
        raise QuantityError(message)
    design: dict[str, Any] = {"explosive": str(value.get("explosive", "anfo"))}
    faults = []
    for name, written in value.items():
        if name == "explosive":
            continue
        if name in _FROM_BENCH:
            faults.append(f"{name}: is taken from 'bench'")
        elif name not in VARIABLES:
            faults.append(f"{name}: unknown variable{nearest_name(str(name), VARIABLES)}")
        else:
            try:
                design[name] = convert_variable(name, written)
            except QuantityError as fault:
                faults.append(f"{name}: {written}: {fault}")
    if faults:
        raise QuantityError("; ".join(faults))
    return design


def _file_or_group(value: object) -> object:
    return {"file": value} if isinstance(value, str) else value


class BenchSpec(Spec):
    """Contents of a bench file.

    Attributes
    ----------
    name : str
    bench : BenchGeometry
    firing : FiringPlan
    velocity : float [m s-1], optional
        Initial velocity of every block.
    surrogate : mapping, optional
        Instead of `velocity`: explosive, rock and hole whose burden velocity a surrogate predicts;
        burden, spacing, height and face angle are those of the bench.
    direction : Direction
    balls : BallsSpec, or the name of an ``.npz`` file
    contact : ContactSpec
    slope : SlopeSpec, optional
    stop : StopRule
    seed : int
    notes : str
    """

    name: Annotated[str, Field(min_length=1)]
    bench: BenchGeometry
    firing: FiringPlan = FiringPlan()
    velocity: Annotated[float, QuantityIn("m s-1", 0.0, 100.0)] | None = None
    surrogate: Annotated[dict[str, Any], BeforeValidator(_read_design)] | None = None
    direction: Direction = Direction()
    balls: Annotated[BallsSpec, BeforeValidator(_file_or_group)]
    contact: ContactSpec = ContactSpec()
    slope: SlopeSpec | None = None
    stop: StopRule = StopRule()
    seed: Annotated[int, Field(ge=0)] = 0
    notes: str = ""

    @model_validator(mode="after")
    def _possible(self) -> BenchSpec:
        faults = []
        given = (self.velocity is not None) + (self.surrogate is not None)
        if self.firing.pattern == "none" and given:
            faults.append("firing.pattern 'none' takes no velocity")
        if self.firing.pattern != "none" and given != 1:
            faults.append("either 'velocity' or 'surrogate' is needed")
        if self.balls.mean_radius is not None:
            faults += self.room_faults(self.balls.mean_radius)
        if faults:
            raise QuantityError("; ".join(faults))
        return self

    def room_faults(self, mean_radius: float) -> list[str]:
        """Say whether balls of a mean radius [m] are too large for the bench; []: they are not."""
        return check_packing(
            self.bench.to_bench(),
            mean_radius,
            self.balls.relative_deviation,
            self.balls.solid_fraction,
        )

    def design(self) -> dict[str, Any] | None:
        """Design for the surrogate in SI units, with the geometry of the bench; None without."""
        if self.surrogate is None:
            return None
        bench = self.bench
        return {
            **self.surrogate,
            "burden": bench.burden,
            "spacing": bench.spacing,
            "bench_height": bench.height,
            "face_angle": bench.face_angle,
        }


def find_bench(name_or_path: str | Path) -> Path:
    """Path of a bench file: one that came with castblast, by name, or a user's own.

    Raises
    ------
    SpecError
        A bare name that no shipped bench has; the nearest is named.
    """
    path = Path(name_or_path)
    if path.suffix or path.parent != Path() or path.is_file():
        return path
    folder = resource(_FOLDER)
    known = sorted(entry.stem for entry in folder.glob("*.yaml"))
    if str(path) in known:
        return folder / f"{path}.yaml"
    hint = nearest_name(str(path), known)
    message = f"unknown bench '{path}'{hint or ';'} known: {', '.join(known)}; or a YAML file"
    raise SpecError(message)


def load_bench(name_or_path: str | Path) -> BenchSpec:
    """Read a bench file.

    Raises
    ------
    SpecError
        One line per fault of the file.
    """
    return load_spec(find_bench(name_or_path), BenchSpec)
