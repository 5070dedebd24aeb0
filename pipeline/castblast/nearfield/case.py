"""Inputs of the near-field model: rock, hole, and settings of the solver. SI units, radians."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]


class EndMode(IntEnum):
    """When a near-field run ends.

    PAPER: at 0.9 of the travel time of the p-wave to the outer boundary. EQUILIBRIUM: when the
    hole wall has come to rest, on a body large enough for that.
    """

    PAPER = 0
    EQUILIBRIUM = 1


class TensionMode(IntEnum):
    """What happens in a zone that yields in tension.

    DUCTILE: stays at the tensile strength; BRITTLE: the strength drops to zero; NONE: no
    cut-off below the apex of the Mohr-Coulomb cone.
    """

    DUCTILE = 0
    BRITTLE = 1
    NONE = 2


class Rock(NamedTuple):
    """Elastic, Mohr-Coulomb rock.

    Attributes
    ----------
    density [kg m-3], young_modulus [Pa], poisson_ratio [-], ucs [Pa], friction_angle [rad],
    dilation_angle [rad], tensile_strength [Pa] : float
    """

    density: float
    young_modulus: float
    poisson_ratio: float
    ucs: float
    friction_angle: float
    dilation_angle: float
    tensile_strength: float


class Hole(NamedTuple):
    """Blasthole and how it is loaded.

    Attributes
    ----------
    diameter : float [m]
    charge_diameter : float [m]
        Equal to `diameter` when fully coupled.
    rise_time : float [s]
        Linear ramp of the gas pressure.
    in_situ_stress : float [Pa]
        Isotropic compression before the blast, positive.
    """

    diameter: float
    charge_diameter: float
    rise_time: float
    in_situ_stress: float


class NearFieldSettings(NamedTuple):
    """Settings of the near-field solver.

    Attributes
    ----------
    mode : EndMode
    tension : TensionMode
    outer_radius : float [m]
        0: 5.5 m in paper mode, 1000 hole radii in equilibrium mode.
    zones : int
        Equilibrium mode: of rock whose front stays elastic, behind the front of the wave; all
        meshes are refined alike. 0: the default of the mode.
    quadratic_viscosity, linear_viscosity : float [-]
        See `castblast.nearfield.rock.lagrangian`; below a linear viscosity of 0.1 weak rock of high
        friction has no answer that converges. Rock that yields in the wave front has none of the
        linear one, whatever is set: see `castblast.nearfield.front`.
    history_points : int
        Length of the pressure and radius histories.
    """

    mode: int = EndMode.EQUILIBRIUM
    tension: int = TensionMode.DUCTILE
    outer_radius: float = 0.0
    zones: int = 0
    quadratic_viscosity: float = 1.5
    linear_viscosity: float = 0.15
    history_points: int = 64


class NearFieldColumns(NamedTuple):
    """Many holes as columns: the fields of `Rock` and `Hole`, SI.

    Attributes
    ----------
    explosive : int array (n,)
        Index of the explosive of every row.
    density, young_modulus, poisson_ratio, ucs, friction_angle, dilation_angle,
    tensile_strength : array (n,)
        As in `Rock`.
    diameter, charge_diameter, rise_time, in_situ_stress : array (n,)
        As in `Hole`.
    """

    explosive: IntArray
    density: FloatArray
    young_modulus: FloatArray
    poisson_ratio: FloatArray
    ucs: FloatArray
    friction_angle: FloatArray
    dilation_angle: FloatArray
    tensile_strength: FloatArray
    diameter: FloatArray
    charge_diameter: FloatArray
    rise_time: FloatArray
    in_situ_stress: FloatArray
