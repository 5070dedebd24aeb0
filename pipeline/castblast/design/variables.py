"""The table of physical variables: one name, unit, bound and meaning for the whole product.

Specs, datasets, networks, the command line and every export read this table, so that a quantity
has one name from YAML to JavaScript. Bounds are plausibility bounds: a value outside is an error
in a spec (a slip of units, most often), not a statement about validity of a model.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Literal

from castblast.names import people_unit

Role = Literal["rock", "hole", "bench", "burden_model", "solver", "target", "energy", "diagnostic"]


@dataclass(frozen=True)
class Variable:
    """One physical variable.

    Attributes
    ----------
    name : str
        The name used everywhere, spelled out, singular.
    unit : str
        SI unit in UDUNITS spelling; ``"1"`` if dimensionless. Angles are in radians.
    long_name : str
        Sentence for people, without a unit.
    lower, upper : float
        Plausibility bounds in `unit`, both allowed.
    role : str
        What the variable belongs to.
    default : float or None
        Value used when none is given; None: derived from others or always required.
    display_unit : str
        Unit that people use, in UDUNITS spelling; empty: `unit`.
    display_factor : float
        Value in `display_unit` = value in `unit` times this factor.
    symbol : str
        Symbol in formulas of the sources.
    """

    name: str
    unit: str
    long_name: str
    lower: float
    upper: float
    role: Role
    default: float | None = None
    display_unit: str = ""
    display_factor: float = 1.0
    symbol: str = ""

    @property
    def shown_unit(self) -> str:
        """Unit for screens as people write it (``m/s``); SI where no other unit is usual."""
        return people_unit(self.file_unit)

    @property
    def file_unit(self) -> str:
        """The same unit in UDUNITS spelling (``m s-1``): for heads of tables and for records."""
        return self.display_unit or self.unit

    def show(self, value: float) -> str:
        """Format an SI value with its display unit, e.g. ``"100 MPa"``."""
        unit = "" if self.shown_unit == "1" else f" {self.shown_unit}"
        return f"{value * self.display_factor:.6g}{unit}"


_DEG = pi / 180.0
_MPA = ("MPa", 1e-6)
_GPA = ("GPa", 1e-9)
_MM = ("mm", 1e3)
_MS = ("ms", 1e3)
_DEGREE = ("deg", 1.0 / _DEG)
_MJ = ("MJ m-1", 1e-6)
_MJ_HOLE = ("MJ", 1e-6)


def _v(
    name: str,
    unit: str,
    role: Role,
    lower: float,
    upper: float,
    long_name: str,
    default: float | None = None,
    symbol: str = "",
    shown: tuple[str, float] = ("", 1.0),
) -> Variable:
    return Variable(name, unit, long_name, lower, upper, role, default, *shown, symbol)


INPUTS: tuple[Variable, ...] = (
    # rock
    _v("ucs", "Pa", "rock", 1e6, 6e8, "uniaxial compressive strength", 1e8, "UCS", _MPA),
    _v("young_modulus", "Pa", "rock", 1e8, 2e11, "Young's modulus", 2e10, "E", _GPA),
    _v("poisson_ratio", "1", "rock", 0.01, 0.49, "Poisson's ratio", 0.25, "nu"),
    _v("rock_density", "kg m-3", "rock", 1e3, 6e3, "rock density", 2600.0, "rho"),
    _v("friction_angle", "rad", "rock", 1 * _DEG, 70 * _DEG, "internal friction angle", 45 * _DEG,
       "phi", _DEGREE),
    _v("dilation_angle", "rad", "rock", 0.0, 60 * _DEG, "dilation angle", 0.0, "psi", _DEGREE),
    _v("tensile_strength", "Pa", "rock", 0.0, 1e8, "tensile strength", 0.0, "sigma_t", _MPA),
    _v("in_situ_stress", "Pa", "rock", 0.0, 2e8, "isotropic in-situ compression", 0.0, "p0", _MPA),
    _v("strength_rate_factor", "1", "rock", 0.5, 10.0,
       "factor on UCS and tensile strength for the loading rate (calibration)", 1.0),
    # hole and charge
    _v("hole_diameter", "m", "hole", 0.02, 0.6, "blasthole diameter", 0.15, "d", _MM),
    _v("charge_diameter", "m", "hole", 0.015, 0.6,
       "charge diameter; equal to the hole diameter when fully coupled", None, "", _MM),
    _v("rise_time", "s", "hole", 0.0, 1e-2,
       "time in which the gas pressure comes up; default: hole diameter over in-hole velocity",
       None, "t_r", ("us", 1e6)),
    # bench
    _v("burden", "m", "bench", 0.2, 30.0, "burden at the crest", 3.0, "B"),
    _v("spacing", "m", "bench", 0.2, 60.0, "hole spacing; default: the burden", None, "S"),
    _v("bench_height", "m", "bench", 1.0, 100.0, "bench height", 12.5, "H"),
    _v("face_angle", "rad", "bench", 30 * _DEG, 90 * _DEG, "bench face angle", 90 * _DEG,
       "beta_f", _DEGREE),
    _v("stemming_length", "m", "bench", 0.0, 50.0,
       "stemming length; default: 0.7 burden, or bench height less charge length", None, "L_s"),
    _v("charge_length", "m", "bench", 0.05, 100.0,
       "charge length; default: bench height less stemming length", None, "L_c"),
    # burden-motion model: checked against a published system, not calibrated on blasts
    _v("pressurised_width_ratio", "1", "burden_model", 0.01, 1.0,
       "burden displacement over mean burden at which the gas fills the break-out plane", 0.10,
       "xi_p"),
    _v("fracture_opening_ratio", "1", "burden_model", 0.0, 1e7,
       "total fracture aperture per burden displacement", 1.0, "eta_f"),
    _v("fracture_count", "1", "burden_model", 1.0, 64.0, "fractures that reach the face", 4.0,
       "n_f"),
    _v("fracture_friction_factor", "1", "burden_model", 0.0, 10.0,
       "Darcy friction factor of a rough fracture", 0.10, "f_D"),
    _v("gas_front_velocity", "m s-1", "burden_model", 10.0, 1e4,
       "speed of the gas front in fractures", 1300.0, "v_gas"),
    _v("crack_velocity", "m s-1", "burden_model", 10.0, 5e3, "speed of the crack tips", 570.0,
       "v_cr"),
    _v("fracture_storage_ratio", "1", "burden_model", 0.0, 20.0,
       "gas volume stored in radial cracks over expanded hole volume", 1.5, "zeta"),
    _v("gas_viscosity", "Pa s", "burden_model", 0.0, 1e-2, "viscosity of the hot gas", 6e-5,
       "mu_g"),
    _v("initial_aperture", "m", "burden_model", 0.0, 0.05,
       "total fracture aperture before the burden moves", 0.0, "w0", _MM),
    _v("stemming_wall_friction", "1", "burden_model", 0.0, 1.0,
       "wall friction times lateral stress ratio of the stemming", 0.12, "mu_k0"),
    _v("stemming_density", "kg m-3", "burden_model", 500.0, 4000.0, "bulk density of the "
       "stemming", 1800.0, "rho_s"),
    _v("stemming_porosity", "1", "burden_model", 0.0, 0.9, "porosity of the stemming", 0.40, "n"),
    _v("stemming_grain_ratio", "1", "burden_model", 1e-3, 0.5,
       "stemming grain size over hole diameter", 1.0 / 15.0, "d_s/d"),
    _v("collar_discharge_coefficient", "1", "burden_model", 0.0, 1.0,
       "discharge coefficient of the open collar", 0.8, "C_d"),
    _v("floor_friction", "1", "burden_model", 0.0, 2.0, "friction of the burden on the floor", 0.0,
       "mu_f"),
    # near-field solver
    _v("outer_radius", "m", "solver", 0.5, 2000.0,
       "outer radius of the rock annulus; default: 5.5 m in paper mode, as far as needed in "
       "equilibrium mode", None, "R_out"),
    _v("zones", "1", "solver", 16.0, 20000.0, "zones of the near-field mesh", None, "N"),
    _v("quadratic_viscosity", "1", "solver", 0.0, 10.0, "quadratic artificial viscosity", 1.5,
       "C_Q"),
    _v("linear_viscosity", "1", "solver", 0.0, 2.0, "linear artificial viscosity", 0.15, "C_L"),
)  # fmt: skip

OUTPUTS: tuple[Variable, ...] = (
    _v("equilibrium_pressure", "Pa", "target", 0.0, 1e11,
       "gas pressure when the hole has come to rest", shown=_MPA, symbol="P_eq"),
    _v("expanded_hole_radius", "m", "target", 0.0, 10.0, "hole radius after expansion", shown=_MM,
       symbol="a_eq"),
    _v("crushed_zone_radius", "m", "target", 0.0, 2000.0,
       "initial radius inside which the plastic shear strain is at least 1 percent", symbol="r_c"),
    _v("burden_velocity", "m s-1", "target", 0.0, 500.0, "final velocity of the burden",
       symbol="v"),
    # near-field diagnostics
    _v("plastic_zone_radius", "m", "diagnostic", 0.0, 2000.0,
       "initial radius of the outermost rock that yielded in shear", symbol="r_shear"),
    _v("hoop_crushed_radius", "m", "diagnostic", 0.0, 2000.0,
       "initial radius of the outermost rock that yielded in shear under compressive hoop stress"),
    _v("tensile_zone_radius", "m", "diagnostic", 0.0, 2000.0,
       "initial radius of the outermost rock that yielded in tension"),
    _v("intense_shear_radius", "m", "diagnostic", 0.0, 2000.0,
       "initial radius inside which the accumulated plastic strain exceeds 20 percent"),
    _v("explosion_pressure", "Pa", "diagnostic", 0.0, 1e11,
       "pressure on the isentrope at the initial hole volume", shown=_MPA),
    _v("equilibrium_time", "s", "diagnostic", 0.0, 10.0,
       "last time at which the hole radius differs by more than 1 percent from its end value",
       shown=_MS),
    _v("end_time", "s", "diagnostic", 0.0, 10.0, "simulated time of the near field", shown=_MS),
    _v("wall_velocity", "m s-1", "diagnostic", -1e4, 1e4, "velocity of the hole wall at the end"),
    _v("settled", "1", "diagnostic", 0.0, 1.0, "1 if the hole wall had come to rest"),
    # near-field ledger, per metre of hole
    _v("gas_work", "J m-1", "energy", -1e12, 1e12, "work of the gas on the rock", shown=_MJ),
    _v("kinetic_energy", "J m-1", "energy", -1e12, 1e12, "kinetic energy of the rock", shown=_MJ),
    _v("elastic_energy", "J m-1", "energy", -1e12, 1e12, "elastic energy of the rock", shown=_MJ),
    _v("plastic_work", "J m-1", "energy", -1e12, 1e12, "work dissipated by shear yield", shown=_MJ),
    _v("tensile_work", "J m-1", "energy", -1e12, 1e12, "work dissipated by tensile yield",
       shown=_MJ),
    _v("viscous_work", "J m-1", "energy", -1e12, 1e12, "work dissipated by artificial viscosity",
       shown=_MJ),
    _v("boundary_work", "J m-1", "energy", -1e12, 1e12, "work done on the outer boundary",
       shown=_MJ),
    _v("head_energy", "J m-1", "energy", -1e12, 1e12,
       "energy delivered by the detonation head before the products fill the hole", shown=_MJ),
    _v("ramp_energy", "J m-1", "energy", -1e12, 1e12, "work not done while the pressure comes up",
       shown=_MJ),
    _v("gas_energy", "J m-1", "energy", -1e12, 1e12, "energy left in the products", shown=_MJ),
    _v("energy_residual", "1", "energy", -1.0, 1.0,
       "open balance of the near-field energy ledger over the gas work"),
    # burden motion, per hole
    _v("powder_factor", "kg m-3", "diagnostic", 0.0, 1e3, "explosive mass per volume of rock"),
    _v("venting_time", "s", "diagnostic", 0.0, 10.0,
       "time at which gas begins to leave through fractures", shown=_MS),
    _v("vented_fraction", "1", "diagnostic", 0.0, 1.0, "share of the gas mass that has left"),
    _v("acceleration_time", "s", "diagnostic", 0.0, 10.0,
       "time at which the burden has 95 percent of its velocity", shown=_MS),
    _v("acceleration_distance", "m", "diagnostic", 0.0, 1e3,
       "displacement at which the burden has 95 percent of its velocity"),
    _v("burden_kinetic_energy", "J", "energy", -1e15, 1e15, "kinetic energy of the burden",
       shown=_MJ_HOLE),
    _v("fracture_work", "J", "energy", -1e15, 1e15, "work spent on filling radial cracks",
       shown=_MJ_HOLE),
    _v("stemming_work", "J", "energy", -1e15, 1e15, "work done on the stemming", shown=_MJ_HOLE),
    _v("vented_enthalpy", "J", "energy", -1e15, 1e15, "enthalpy of the vented gas", shown=_MJ_HOLE),
    _v("burden_energy_residual", "1", "energy", -1.0, 1.0,
       "open balance of the burden ledger over the initial gas energy"),
)  # fmt: skip

VARIABLES: dict[str, Variable] = {v.name: v for v in INPUTS + OUTPUTS}
INPUT_NAMES: tuple[str, ...] = tuple(v.name for v in INPUTS)
OUTPUT_NAMES: tuple[str, ...] = tuple(v.name for v in OUTPUTS)

#: Stemming length over burden where neither stemming nor charge length is given.
STEMMING_RATIO = 0.7

#: Named parameter sets of the burden-motion model. `authors` reproduces the level of the published
#: web tool of Furtney et al.; `field` starts from measured gas-front speeds. Neither is calibrated
#: on measured blasts.
BURDEN_PARAMETER_SETS: dict[str, dict[str, float]] = {
    "authors": {"gas_front_velocity": 1300.0, "fracture_storage_ratio": 1.5},
    "field": {"gas_front_velocity": 240.0, "fracture_storage_ratio": 1.0},
}
