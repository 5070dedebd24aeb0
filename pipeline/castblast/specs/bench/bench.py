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

from castblast.design.variables import VARIABLES
from castblast.disk.resources import find_spec
from castblast.errors import nearest_name
from castblast.muckpile.balls.contact import ContactLaw, DashpotMode
from castblast.muckpile.bench.geometry import Bench, check_bench, polygon_bench
from castblast.muckpile.bench.outline import polygon_area
from castblast.muckpile.bench.packing import check_packing
from castblast.names import shortened
from castblast.specs.bench.balls.spec import BallsSpec
from castblast.specs.bench.firing import Direction, FiringPlan
from castblast.specs.bench.frame import FrameSpec
from castblast.specs.bench.ground.spec import GroundSpec, one_or_many
from castblast.specs.loading import Name, Spec, load_spec
from castblast.specs.quantity import QuantityError, QuantityIn, convert, convert_variable

_RIGHT_ANGLE = math.pi / 2.0
_FROM_BENCH = ("burden", "spacing", "bench_height", "face_angle")

_Length = Annotated[float, QuantityIn("m", above=0.0, upper=2000.0)]


def _read_corners(value: object) -> tuple[tuple[float, float], ...]:
    """Corners written as pairs of quantities, ``[-3 m, 0 m]``."""
    if not isinstance(value, list | tuple) or len(value) < 3:
        message = "at least three corners are needed, such as [-3 m, 0 m]"
        raise QuantityError(message)
    corners, faults = [], []
    for k, corner in enumerate(value):
        if not isinstance(corner, list | tuple) or len(corner) != 2:
            faults.append(
                f"corner {k + 1}: {shortened(corner)}: two lengths are needed, such as [-3 m, 0 m]"
            )
            continue
        try:
            corners.append((convert(corner[0], "m"), convert(corner[1], "m")))
        except QuantityError as fault:
            faults.append(f"corner {k + 1}: {shortened(corner)}: {fault}")
    if faults:
        raise QuantityError("; ".join(faults))
    return tuple(corners)


class BenchGeometry(Spec):
    """The bench and what stands around it; blocks are one burden by one spacing in plan.

    Attributes
    ----------
    length, width : float [m]
        Of a rectangle, along the face and across; left out if there is an outline.
    height : float [m]
    face_angle : float [rad]
        Of the free faces over the horizontal.
    outline : corners [x m, y m], optional
        Polygon of the floor in plan, in either sense; its foremost point at x = 0, its least y 0.
    edges : list of {"free", "rock", "open"}, optional
        What lies beyond each edge, from corner k to the next; default: free towards the throw, rock
        behind the bench, open at its ends.
    burden, spacing : float [m]
    rear, ends
        Of a rectangle: whether rock stands behind it, and what is at its ends.
    """

    length: _Length | None = None
    width: _Length | None = None
    height: _Length
    face_angle: Annotated[float, QuantityIn("rad", 0.1, _RIGHT_ANGLE + 1e-12)] = _RIGHT_ANGLE
    outline: Annotated[tuple[tuple[float, float], ...], BeforeValidator(_read_corners)] | None = (
        None
    )
    edges: tuple[Literal["free", "rock", "open"], ...] | None = None
    burden: _Length = 3.0
    spacing: _Length = 3.0
    rear: bool = True
    ends: Literal["open", "wall", "mirror"] = "open"

    def to_bench(self) -> Bench:
        """Geometry as the discrete-element model takes it."""
        angle = min(self.face_angle, _RIGHT_ANGLE)
        if self.outline is None:
            length, width = self.length or math.nan, self.width or math.nan
            return Bench(
                length=length,
                width=width,
                height=self.height,
                face_angle=angle,
                burden=self.burden,
                spacing=self.spacing,
            )
        corners, edges = list(self.outline), list(self.edges or ())
        if polygon_area(np.array(corners)) < 0.0:
            # Turned round, the edge from corner k to k + 1 comes last but k.
            corners.reverse()
            edges = [*edges[-2::-1], *edges[-1:]]
        return polygon_bench(
            corners,
            self.height,
            angle,
            edges=tuple(edges),
            burden=self.burden,
            spacing=self.spacing,
        )

    @model_validator(mode="after")
    def _possible(self) -> BenchGeometry:
        sides = [name for name in ("length", "width") if getattr(self, name) is not None]
        faults = []
        if self.outline is None:
            faults += [f"{n}: is missing" for n in ("length", "width") if n not in sides]
            if self.edges is not None:
                faults.append("edges: go with an outline")
        else:
            beside = [*sides, *({"rear", "ends"} & self.model_fields_set)]
            faults += [f"{name}: means nothing beside an outline" for name in sorted(beside)]
        if not faults:
            bench = self.to_bench()
            faults = check_bench(bench)
            for block, side in (("burden", "width"), ("spacing", "length")):
                size, room = getattr(bench, block), getattr(bench, side)
                if size > room:
                    faults.append(
                        f"{block} {size:g} m: the block is larger than the {side} {room:g} m"
                    )
        if faults:
            raise QuantityError("; ".join(faults))
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


class Numerics(Spec):
    """How the equations are solved; the default step is the stability rule.

    Attributes
    ----------
    time_step : float, optional [s]
        A fixed step; refused if the packing cannot be stepped so.
    step_safety : float [-]
        Share of the stable step that is used.
    precision : {"mixed", "float64"}
        Mixed: motion and memory of contacts in single precision, places in double.
    """

    time_step: Annotated[float, QuantityIn("s", above=0.0, upper=1.0)] | None = None
    step_safety: Annotated[float, QuantityIn("1", 0.05, 0.95)] = 0.8
    precision: Literal["mixed", "float64"] = "mixed"


class StopRule(Spec):
    """The end: translational energy below a share of its maximum for a while, or a longest time."""

    energy_ratio: Annotated[float, QuantityIn("1", 0.0, 0.5)] = 1e-4
    duration: Annotated[float, QuantityIn("s", 0.0, 10.0)] = 0.2
    longest_time: Annotated[float, QuantityIn("s", above=0.0, upper=600.0)] = 30.0


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
            faults.append(
                f"{shortened(name)}: unknown variable{nearest_name(str(name), VARIABLES)}"
            )
        else:
            try:
                design[name] = convert_variable(name, written)
            except QuantityError as fault:
                faults.append(f"{name}: {shortened(written)}: {fault}")
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
    frame : FrameSpec, optional
        Where the bench lies in the grid of the mine. The files of holes and of ore are in that grid
        then; everything else, and all results, stay in the frame of the bench.
    velocity : float [m s-1], optional
        Initial velocity of every block, or of those holes of a file that have none of their own.
    surrogate : mapping, optional
        Instead of `velocity`: explosive, rock and hole whose burden velocity a surrogate predicts;
        burden, spacing, height and face angle are those of the bench.
    direction : Direction
    balls : BallsSpec, or the name of a file of balls
    contact : ContactSpec
    slope : SlopeSpec, optional
    ground : GroundSpec, the name of a file, or a list of both
        What lies before the bench: heights of a survey or of an earlier pile, or an STL surface.
    stop : StopRule
    numerics : Numerics
    ore : str, optional
        File of ore polygons, relative to the bench file.
    seed : int
    notes : str
    """

    name: Name
    bench: BenchGeometry
    firing: FiringPlan = FiringPlan()
    frame: FrameSpec | None = None
    velocity: Annotated[float, QuantityIn("m s-1", 0.0, 100.0)] | None = None
    surrogate: Annotated[dict[str, Any], BeforeValidator(_read_design)] | None = None
    direction: Direction = Direction()
    balls: Annotated[BallsSpec, BeforeValidator(_file_or_group)]
    contact: ContactSpec = ContactSpec()
    slope: SlopeSpec | None = None
    ground: Annotated[tuple[GroundSpec, ...], BeforeValidator(one_or_many)] = ()
    stop: StopRule = StopRule()
    numerics: Numerics = Numerics()
    ore: Annotated[str, Field(min_length=1)] | None = None
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    notes: str = ""

    @model_validator(mode="after")
    def _possible(self) -> BenchSpec:
        faults = []
        given = (self.velocity is not None) + (self.surrogate is not None)
        if self.firing.pattern == "none" and given:
            faults.append("firing.pattern 'none' takes no velocity")
        if self.firing.pattern == "holes" and given == 2:
            faults.append("either 'velocity' or 'surrogate', not both")
        elif self.firing.pattern not in ("none", "holes") and given != 1:
            faults.append("either 'velocity' or 'surrogate' is needed")
        if self.balls.mean_radius is not None:
            faults += check_packing(
                self.bench.to_bench(),
                self.balls.mean_radius,
                self.balls.relative_deviation,
                self.balls.solid_fraction,
            )
        if faults:
            raise QuantityError("; ".join(faults))
        return self

    def files(self) -> list[str]:
        """Names of the files that belong to the bench, relative to its own."""
        grounds = [ground.heightmap or ground.stl for ground in self.ground]
        named = (self.balls.file, self.firing.holes, self.ore, *grounds)
        return list(dict.fromkeys(str(name) for name in named if name is not None))

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


def load_bench(name_or_path: str | Path) -> BenchSpec:
    """Read a bench file.

    Raises
    ------
    SpecError
        One line per fault of the file.
    """
    return load_spec(find_spec(name_or_path, "bench"), BenchSpec)
