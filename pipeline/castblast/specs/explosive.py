"""An explosive as a file: detonation state, isentrope as JWL constants or table, and its source.

The catalogue is the folder ``data_specs/explosives``; a user's own file has the same form. What a
file leaves out and the relations of the detonation give (C, E0, the CJ state) is worked out here.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from castblast.errors import CheckError, SpecError
from castblast.explosive.checks import check_jwl
from castblast.explosive.cj import (
    CjState,
    CompleteJwl,
    JwlSet,
    cj_from_pressure,
    complete_jwl,
    energy_behind,
    jwl_constant_volume_pressure,
    touching_state,
)
from castblast.explosive.finding import Finding, rejected, warned
from castblast.explosive.isentrope import (
    Explosive,
    ProductIsentrope,
    jwl_isentrope,
    tabulated_isentrope,
)
from castblast.explosive.remedies import remedies
from castblast.explosive.table_checks import check_table
from castblast.names import shortened
from castblast.specs.catalogue import find_explosive
from castblast.specs.loading import Label, Spec, load_spec
from castblast.specs.quantity import QuantityError, QuantityIn, convert
from castblast.types import FloatArray


def _read_table(value: object) -> tuple[tuple[float, ...], ...]:
    """Rows [V, P] or [V, P, E]; P and E with a unit, or bare numbers in Pa and J/m3."""
    if not isinstance(value, list) or not value:
        message = "a list of rows [V, P] or [V, P, E] is needed"
        raise QuantityError(message)
    rows, faults = [], []
    for number, row in enumerate(value, start=1):
        if not isinstance(row, list) or len(row) not in (2, 3) or len(row) != len(value[0]):
            faults.append(
                f"row {number} ({shortened(row)}): [V, P] or [V, P, E] is needed, the same in all"
            )
            continue
        try:
            units = ("1", "Pa", "Pa")[: len(row)]
            rows.append(tuple(_si(cell, unit) for cell, unit in zip(row, units, strict=True)))
        except QuantityError as fault:
            faults.append(f"row {number} ({shortened(row)}): {fault}")
    if faults:
        raise QuantityError("; ".join(faults[:5]))
    return tuple(rows)


def _si(cell: object, unit: str) -> float:
    """A table cell; a bare number is SI already."""
    return convert(cell, unit if isinstance(cell, str) else "1")


class JwlSpec(Spec):
    """JWL constants; C or E0 may be left out where the CJ state gives them.

    Attributes
    ----------
    A, B, C : float [Pa]
    R1, R2, omega : float [-]
    E0 : float [J m-3]
        Work to infinite expansion per initial volume.
    """

    elsewhere: ClassVar[Mapping[str, str]] = {
        "w": "omega",
        "om": "omega",
        "E": "E0",
        "e0": "E0",
        "R_1": "R1",
        "R_2": "R2",
    }

    A: Annotated[float, QuantityIn("Pa")]
    B: Annotated[float, QuantityIn("Pa")]
    C: Annotated[float, QuantityIn("Pa")] | None = None
    R1: Annotated[float, QuantityIn("1", above=0.0)]
    R2: Annotated[float, QuantityIn("1", above=0.0)]
    omega: Annotated[float, QuantityIn("1", above=0.0)]
    E0: Annotated[float, QuantityIn("Pa", above=0.0)] | None = None


class DiameterEffect(Spec):
    """In-hole velocity of detonation D = D_CJ [1 - coefficient (0.1 m / d)^exponent]."""

    coefficient: Annotated[float, QuantityIn("1", 0.0, 1.0)] = 0.0
    exponent: Annotated[float, QuantityIn("1", 0.0, 3.0)] = 1.0


class ExplosiveSpec(Spec):
    """Contents of an explosive file.

    Attributes
    ----------
    name : str
    aliases : tuple of str
        Other names under which the catalogue finds it.
    density : float [kg m-3]
    detonation_velocity : float [m s-1]
        Ideal velocity D of the CJ state.
    heat_of_explosion : float [J kg-1]
        With water as vapour; the denominator of reported energy shares.
    cj_pressure : float [Pa], optional
    jwl : JwlSpec, optional
    isentrope : rows of (V [-], P [Pa]) or (V, P, E [J m-3]), optional
        Either this or `jwl`.
    diameter_effect : DiameterEffect
    composition : mapping of str to mass share [-], optional
    source : str
        Where the numbers come from; required.
    derived : tuple of str
        Fields derived by this project rather than read from the source.
    notes : str
    """

    elsewhere: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(("rho", "rho0", "ro"), "density"),
        **dict.fromkeys(("D", "vod", "v_cj", "d_cj", "detonation_speed"), "detonation_velocity"),
        **dict.fromkeys(("P_CJ", "pcj", "p_j", "cj"), "cj_pressure"),
        **dict.fromkeys(("Q", "heat", "Q_v"), "heat_of_explosion"),
    }

    name: Label
    aliases: tuple[Label, ...] = ()
    density: Annotated[float, QuantityIn("kg m-3", 200.0, 4000.0)]
    detonation_velocity: Annotated[float, QuantityIn("m s-1", 1000.0, 10000.0)]
    heat_of_explosion: Annotated[
        float, QuantityIn("J kg-1", 1e5, 2e7, hint="1 MJ/kg is 1 kJ/g or 1e12 mJ/t")
    ]
    cj_pressure: Annotated[float, QuantityIn("Pa", 1e8, 1e11)] | None = None
    jwl: JwlSpec | None = None
    isentrope: Annotated[tuple[tuple[float, ...], ...], BeforeValidator(_read_table)] | None = None
    diameter_effect: DiameterEffect = DiameterEffect()
    composition: dict[str, Annotated[float, QuantityIn("1", 0.0, 1.0)]] | None = None
    source: Annotated[str, Field(min_length=1)]
    derived: tuple[str, ...] = ()
    notes: str = ""

    @field_validator("jwl", mode="before")
    @classmethod
    def _energy_per_volume(cls, value: object, info: ValidationInfo) -> object:
        """Offer the product where E0 is written per mass, as some hydrocodes take it."""
        written = value.get("E0") if isinstance(value, Mapping) else None
        density = info.data.get("density")
        if density is None or not isinstance(written, str):
            return value
        try:
            per_mass = convert(written, "J kg-1")
        except QuantityError:
            return value
        message = (
            f"E0: {written}: is an energy per mass; an energy per volume is needed: times the "
            f"density of {density:g} kg/m3 it is {per_mass * density * 1e-9:.5g} GPa"
        )
        raise QuantityError(message)

    @model_validator(mode="after")
    def _one_isentrope(self) -> ExplosiveSpec:
        if (self.jwl is None) == (self.isentrope is None):
            message = "either 'jwl' or 'isentrope' is needed"
            raise ValueError(message)
        jwl = self.jwl
        if jwl and jwl.C is None and jwl.E0 is None and self.cj_pressure is None:
            message = "jwl: C, E0 or else cj_pressure is needed"
            raise ValueError(message)
        return self

    def jwl_set(self) -> JwlSet | None:
        """JWL constants as stated; None for a table."""
        jwl = self.jwl
        if jwl is None:
            return None
        return JwlSet(
            density=self.density,
            detonation_velocity=self.detonation_velocity,
            a=jwl.A,
            b=jwl.B,
            r1=jwl.R1,
            r2=jwl.R2,
            omega=jwl.omega,
            c=jwl.C,
            total_energy=jwl.E0,
            cj_pressure=self.cj_pressure,
        )

    def table(self) -> tuple[FloatArray, FloatArray, FloatArray | None] | None:
        """Relative volume, pressure [Pa] and energy [J m-3] or None; None for a JWL set."""
        if self.isentrope is None:
            return None
        columns = np.array(self.isentrope, dtype=np.float64).T
        return columns[0], columns[1], columns[2] if len(columns) == 3 else None

    def check(self) -> list[Finding]:
        """Hold the numbers against each other; see `castblast.explosive.checks`."""
        jwl, table = self.jwl_set(), self.table()
        if jwl is not None:
            return check_jwl(jwl, self.heat_of_explosion)
        if table is None:  # the validator refuses this
            return []
        return check_table(
            *table,
            density=self.density,
            detonation_velocity=self.detonation_velocity,
            heat_of_explosion=self.heat_of_explosion,
            cj_pressure=self.cj_pressure,
        )

    def remedies(self) -> list[str]:
        """What would make rejected numbers fit, in words; a table has no such hints."""
        jwl = self.jwl_set()
        return [] if jwl is None else remedies(jwl, self.heat_of_explosion)

    def cj_state(self) -> CjState | None:
        """CJ state: as stated, or where the isentrope touches the Rayleigh line; None: nowhere."""
        complete = self._complete()
        return complete.cj if complete else None

    def constant_volume_pressure(self) -> float | None:
        """Pressure [Pa] at V = 1 with the full energy; None for a table, which is an isentrope."""
        jwl, complete = self.jwl_set(), self._complete()
        if jwl is None or complete is None:
            return None
        return jwl_constant_volume_pressure(jwl, complete.total_energy)

    def _complete(self) -> CompleteJwl | None:
        jwl = self.jwl_set()
        return self._complete_table() if jwl is None else complete_jwl(jwl)

    def _complete_table(self) -> CompleteJwl | None:
        table = self.table()
        if table is None:
            return None
        isentrope = tabulated_isentrope(*table)
        state = touching_state(isentrope, self.density, self.detonation_velocity)
        if state is None:
            return None
        total_energy = energy_behind(isentrope, state)
        if self.cj_pressure is not None:
            state = cj_from_pressure(self.density, self.detonation_velocity, self.cj_pressure)
        return CompleteJwl(isentrope, state, total_energy)

    def to_explosive(self) -> Explosive:
        """What the physics needs, in SI units.

        Raises
        ------
        SpecError
            The numbers have no CJ state and leave out what would have followed from it.
        """
        isentrope, total_energy = self._isentrope_and_energy()
        effect = self.diameter_effect
        return Explosive(
            density=self.density,
            detonation_velocity=self.detonation_velocity,
            heat_of_explosion=self.heat_of_explosion,
            total_energy=total_energy,
            diameter_coefficient=effect.coefficient,
            diameter_exponent=effect.exponent,
            isentrope=isentrope,
        )

    def _isentrope_and_energy(self) -> tuple[ProductIsentrope, float]:
        complete, jwl = self._complete(), self.jwl
        if complete is not None:
            return complete.isentrope, complete.total_energy
        if jwl is not None and jwl.C is not None and jwl.E0 is not None:
            return jwl_isentrope(jwl.A, jwl.B, jwl.C, jwl.R1, jwl.R2, jwl.omega), jwl.E0
        message = (
            f"{self.name}: no CJ state follows from these numbers; run 'castblast explosive check'"
        )
        raise SpecError(message)


def require_consistent(spec: ExplosiveSpec, *, allow_inconsistent: bool = False) -> list[str]:
    """Refuse an explosive whose numbers do not belong together; return remarks for people.

    Raises
    ------
    CheckError
        A relation failed; every failed one is named with its value.
    """
    findings = spec.check()
    failed = rejected(findings)
    if failed and not allow_inconsistent:
        lines = [f"{spec.name}: inconsistent explosive: {finding}" for finding in failed]
        lines += [f"{spec.name}: {line}" for line in spec.remedies()]
        lines.append("mend the file, or run it as it is with --allow-inconsistent")
        raise CheckError("\n".join(lines))
    return [f"{spec.name}: {finding}" for finding in [*failed, *warned(findings)]]


def load_explosive(name_or_path: str | Path) -> ExplosiveSpec:
    """Read an explosive of the catalogue, by name or alias, or a user's own file.

    Raises
    ------
    SpecError
        Unknown name (the nearest is named), or faults of the file.
    """
    return load_spec(find_explosive(name_or_path), ExplosiveSpec)
