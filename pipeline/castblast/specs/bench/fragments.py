"""Fragment sizes as written in a bench file: Kuz-Ram or Swebrec, predicted or measured."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, model_validator

from castblast.design.hole import charge_mass
from castblast.design.rule import resolve_design
from castblast.design.variables import VARIABLES
from castblast.errors import SpecError
from castblast.muckpile.bench.fragments import (
    Pattern,
    RosinRammler,
    SizeCurve,
    joint_factor,
    kuz_ram,
    rock_factor,
    swebrec_like,
)
from castblast.muckpile.bench.geometry import Bench
from castblast.specs.explosive import load_explosive
from castblast.specs.loading import Spec
from castblast.specs.quantity import QuantityError, QuantityIn, VariableIn

_Size = Annotated[float, QuantityIn("m", 1e-3, 20.0)]
_DESCRIPTIONS = {"friable": 10.0, "massive": 50.0}


class FragmentsSpec(Spec):
    """Sizes of fragments by mass, cut to what balls can show.

    Attributes
    ----------
    model : {"swebrec", "kuz_ram"}
        Shape of the curve. Swebrec takes median and slope from Kuz-Ram unless they are given.
    year : {"2005", "1987"}
        Form of Kuz-Ram.
    median, uniformity : float, optional
        Of a measured curve, instead of the prediction.
    largest_block : float, optional [m]
        Blocks of the rock mass; Swebrec ends at the least of it, burden and spacing.
    smallest, largest : float, optional [m]
        Diameters at which the curve is cut. Without `smallest` it follows from the number of balls.
        The largest is that of the curve, or where 99 % pass.
    rock_factor : float, optional [-]
        Instead of `rock`, joints and the properties of the rock.
    rock : {"friable", "massive", "jointed"}
    joint_spacing : float, optional [m]
    joint_dip, joint_condition : str
    explosive, hole_diameter, charge_length, ucs, young_modulus, rock_density, poisson_ratio
        Optional; those of `surrogate`, or the defaults of `castblast.design.variables`.
    weight_strength : float, optional [-]
        By mass over ANFO; default: the ratio of the heats of explosion.
    drilling_deviation : float [m]
    hole_delay, delay_deviation : float [s]
        2005: delay between holes and its standard deviation; 0: no correction for timing.
    """

    model: Literal["swebrec", "kuz_ram"] = "swebrec"
    year: Annotated[Literal["1987", "2005"], BeforeValidator(str)] = "2005"
    median: _Size | None = None
    uniformity: Annotated[float, QuantityIn("1", 0.3, 5.0)] | None = None
    largest_block: _Size | None = None
    smallest: _Size | None = None
    largest: _Size | None = None
    rock_factor: Annotated[float, QuantityIn("1", 0.8, 22.0)] | None = None
    rock: Literal["friable", "massive", "jointed"] = "massive"
    joint_spacing: _Size | None = None
    joint_dip: Literal["out_of_face", "along_face", "into_face"] = "along_face"
    joint_condition: Literal["tight", "relaxed", "filled"] = "tight"
    explosive: str | None = None
    weight_strength: Annotated[float, QuantityIn("1", 0.3, 3.0)] | None = None
    hole_diameter: Annotated[float, VariableIn("hole_diameter")] | None = None
    charge_length: Annotated[float, VariableIn("charge_length")] | None = None
    ucs: Annotated[float, VariableIn("ucs")] | None = None
    young_modulus: Annotated[float, VariableIn("young_modulus")] | None = None
    rock_density: Annotated[float, VariableIn("rock_density")] | None = None
    poisson_ratio: Annotated[float, VariableIn("poisson_ratio")] | None = None
    drilling_deviation: Annotated[float, QuantityIn("m", 0.0, 5.0)] = 0.0
    hole_delay: Annotated[float, QuantityIn("s", 0.0, 1.0)] = 0.0
    delay_deviation: Annotated[float, QuantityIn("s", 0.0, 0.1)] = 0.0

    @model_validator(mode="after")
    def _complete(self) -> FragmentsSpec:
        faults = []
        if (self.median is None) != (self.uniformity is None):
            faults.append("'median' and 'uniformity' of a measured curve go together")
        if self.rock == "jointed" and self.joint_spacing is None and self.rock_factor is None:
            faults.append("joint_spacing: is needed for rock 'jointed'")
        if self.smallest and self.largest and self.smallest >= self.largest:
            faults.append(
                f"smallest {self.smallest:g} m: must be below the largest, {self.largest:g} m"
            )
        if faults:
            raise QuantityError("; ".join(faults))
        return self


def fragment_curve(spec: FragmentsSpec, bench: Bench, design: Mapping[str, Any]) -> SizeCurve:
    """Size curve of a bench.

    Parameters
    ----------
    spec : FragmentsSpec
    bench : Bench
    design : mapping
        Explosive and variables [SI] that `spec` leaves open.

    Raises
    ------
    SpecError
        Unknown explosive.
    ValueError
        The median is not below the largest fragment, or a design that no bench can hold.
    """
    if spec.median is not None and spec.uniformity is not None:
        curve = RosinRammler(spec.median, spec.uniformity)
    else:
        curve = kuz_ram(_pattern(spec, bench, design), spec.year)
    if spec.model == "kuz_ram":
        return curve
    block = min(bench.burden, bench.spacing, spec.largest_block or math.inf)
    return swebrec_like(curve, block)


def _pattern(spec: FragmentsSpec, bench: Bench, design: Mapping[str, Any]) -> Pattern:
    def value(name: str) -> float:
        own = getattr(spec, name)
        return float(design.get(name, VARIABLES[name].default) if own is None else own)

    explosive = load_explosive(spec.explosive or design.get("explosive", "anfo"))
    strength = spec.weight_strength
    if strength is None:
        strength = explosive.heat_of_explosion / load_explosive("anfo").heat_of_explosion
    hole = _hole(spec, bench, design)
    density, modulus, ratio = (value(n) for n in ("rock_density", "young_modulus", "poisson_ratio"))
    description = _DESCRIPTIONS.get(spec.rock, 0.0)
    if spec.rock == "jointed" and spec.joint_spacing is not None:
        description = joint_factor(
            spec.joint_spacing,
            math.sqrt(bench.burden * bench.spacing),
            spec.joint_dip,
            spec.joint_condition,
        )
    factor = spec.rock_factor or rock_factor(
        description=description, density=density, young_modulus=modulus, ucs=value("ucs")
    )
    stiffness = modulus * (1.0 - ratio) / ((1.0 + ratio) * (1.0 - 2.0 * ratio))
    return Pattern(
        rock_factor=factor,
        burden=bench.burden,
        spacing=bench.spacing,
        bench_height=bench.height,
        hole_diameter=hole["hole_diameter"],
        charge_length=hole["charge_length"],
        charge_mass=charge_mass(explosive.density, hole["charge_diameter"], hole["charge_length"]),
        weight_strength=strength,
        drilling_deviation=spec.drilling_deviation,
        delay=spec.hole_delay,
        delay_deviation=spec.delay_deviation,
        wave_velocity=math.sqrt(stiffness / density),
    )


def _hole(spec: FragmentsSpec, bench: Bench, design: Mapping[str, Any]) -> dict[str, float]:
    """Inputs of the hole by the rule of a design: those of `spec`, of `design`, completed."""
    own = {
        "hole_diameter": spec.hole_diameter,
        "charge_length": spec.charge_length,
        "burden": bench.burden,
        "spacing": bench.spacing,
        "bench_height": bench.height,
    }
    names = ("hole_diameter", "charge_diameter", "stemming_length", "charge_length")
    values = {name: float(design[name]) for name in names if name in design}
    if spec.charge_length is not None:
        values.pop("stemming_length", None)  # that of the surrogate goes with its own charge
    try:
        return resolve_design(values | {n: v for n, v in own.items() if v is not None})
    except SpecError as fault:
        raise ValueError("; ".join(str(fault).splitlines())) from None
