"""Records of the burden-motion model: bench and charge, calibration, result. SI, radians."""

from __future__ import annotations

from typing import NamedTuple

from castblast.types import FloatArray, IntArray


class BurdenGeometry(NamedTuple):
    """One vertical blasthole, the rock in front of it and how the hole is charged.

    Attributes
    ----------
    burden : float [m]
        Distance of the hole from the face at the crest.
    spacing : float [m]
        Distance of the holes along the face.
    bench_height : float [m]
    face_angle : float [rad]
        Dip of the bench face; pi/2 is vertical.
    stemming_length, charge_length : float [m]
        Stemming at the collar and charge below it; a hole may end above the floor.
    rock_density : float [kg m-3]
    hole_diameter, charge_diameter : float [m]
        Equal when the charge is fully coupled.
    """

    burden: float
    spacing: float
    bench_height: float
    face_angle: float
    stemming_length: float
    charge_length: float
    rock_density: float
    hole_diameter: float
    charge_diameter: float


class BurdenParameters(NamedTuple):
    """Parameters of the burden-motion model: calibrated, not validated.

    Names and meaning are those of `castblast.design.variables` with the role ``burden_model``;
    units SI.

    Attributes
    ----------
    pressurised_width_ratio : float [-]
        Burden displacement over mean burden at which the gas fills the break-out plane.
    fracture_opening_ratio : float [-]
        Total fracture aperture per burden displacement; 0 with no initial aperture: no venting.
    fracture_count : float [-]
        Fractures that reach the face.
    fracture_friction_factor : float [-]
        Darcy friction factor of a rough fracture.
    gas_front_velocity : float [m s-1]
        Sets the time at which the gas reaches the face and venting starts.
    crack_velocity : float [m s-1]
        Sets the time in which the radial cracks fill.
    fracture_storage_ratio : float [-]
        Gas volume in radial cracks over the expanded hole volume.
    gas_viscosity : float [Pa s]
    initial_aperture : float [m]
        Total fracture aperture before the burden moves.
    stemming_wall_friction : float [-]
        Wall friction times lateral stress ratio; a large value locks the stemming.
    stemming_density : float [kg m-3]
    stemming_porosity : float [-]
        0: the stemming does not leak.
    stemming_grain_ratio : float [-]
        Grain size over hole diameter.
    collar_discharge_coefficient : float [-]
        Of the open hole after the stemming is out.
    floor_friction : float [-]
        Friction coefficient of the burden on the floor.
    """

    pressurised_width_ratio: float
    fracture_opening_ratio: float
    fracture_count: float
    fracture_friction_factor: float
    gas_front_velocity: float
    crack_velocity: float
    fracture_storage_ratio: float
    gas_viscosity: float
    initial_aperture: float
    stemming_wall_friction: float
    stemming_density: float
    stemming_porosity: float
    stemming_grain_ratio: float
    collar_discharge_coefficient: float
    floor_friction: float


class BurdenColumns(NamedTuple):
    """Many cases: the fields of `BurdenGeometry` and `BurdenParameters` as columns of n rows.

    Attributes
    ----------
    explosive : int array (n,)
        Index into the explosives of the batch.
    expanded_hole_radius : array (n,) [m]
        Hole radius at the end of the near field; NaN where there is none.
    others : arrays (n,)
        Float64 and C-contiguous, named and meant as in the records of one case.
    """

    explosive: IntArray
    burden: FloatArray
    spacing: FloatArray
    bench_height: FloatArray
    face_angle: FloatArray
    stemming_length: FloatArray
    charge_length: FloatArray
    rock_density: FloatArray
    hole_diameter: FloatArray
    charge_diameter: FloatArray
    pressurised_width_ratio: FloatArray
    fracture_opening_ratio: FloatArray
    fracture_count: FloatArray
    fracture_friction_factor: FloatArray
    gas_front_velocity: FloatArray
    crack_velocity: FloatArray
    fracture_storage_ratio: FloatArray
    gas_viscosity: FloatArray
    initial_aperture: FloatArray
    stemming_wall_friction: FloatArray
    stemming_density: FloatArray
    stemming_porosity: FloatArray
    stemming_grain_ratio: FloatArray
    collar_discharge_coefficient: FloatArray
    floor_friction: FloatArray
    expanded_hole_radius: FloatArray


class BurdenResult(NamedTuple):
    """Outcome of the burden motion of one hole; NaN throughout if it could not run.

    Attributes
    ----------
    status : int
        A `castblast.errors.Status`.
    burden_velocity : float [m s-1]
        When the gas stops pushing the burden faster.
    powder_factor : float [kg m-3]
    venting_time : float [s]
        When the gas front reaches the face and venting through fractures starts.
    vented_fraction : float [-]
        Share of the gas mass that has left, by fractures and collar.
    collar_fraction : float [-]
        Part of it that left through the stemming or the open collar.
    ejection_time : float [s]
        When the stemming has left the hole; inf if it stays.
    acceleration_time, acceleration_distance : float [s], [m]
        When and where the burden has 95 percent of its velocity; 0 if it does not move.
    motion_time : float [s]
        When the gas stops pushing and the run ends.
    burden_kinetic_energy : float [J]
        Per hole, as all energies here.
    fracture_work : float [J]
        Work on the radial cracks that fill with gas.
    stemming_work : float [J]
        Work of the gas on the stemming: its motion, wall friction and the air it displaces.
    vented_enthalpy : float [J]
    atmospheric_work : float [J]
        Work of the burden against the open air.
    floor_work : float [J]
        Work of the burden against friction on the floor.
    initial_gas_energy, final_gas_energy : float [J]
        Energy in the products at the start and, in what is left of them, at the end.
    burden_energy_residual : float [-]
        Initial gas energy less all terms above, over the initial gas energy.
    mass_residual : float [-]
        Initial gas mass less what is left and what has vented, over the initial gas mass.
    n_steps : int
        Accepted steps of the integrator.
    history_time, history_pressure, history_velocity, history_displacement : array (n,)
        Motion at times that crowd at the start, t_end (i / (n - 1))^2; s, Pa, m s-1, m.
    """

    status: int
    burden_velocity: float
    powder_factor: float
    venting_time: float
    vented_fraction: float
    collar_fraction: float
    ejection_time: float
    acceleration_time: float
    acceleration_distance: float
    motion_time: float
    burden_kinetic_energy: float
    fracture_work: float
    stemming_work: float
    vented_enthalpy: float
    atmospheric_work: float
    floor_work: float
    initial_gas_energy: float
    final_gas_energy: float
    burden_energy_residual: float
    mass_residual: float
    n_steps: int
    history_time: FloatArray
    history_pressure: FloatArray
    history_velocity: FloatArray
    history_displacement: FloatArray


class BurdenBatch(NamedTuple):
    """Outcome of many cases: the numbers of `BurdenResult` as columns of n rows, no histories.

    `status` and `n_steps` are int64; where the status is not OK, all others are NaN.
    """

    status: IntArray
    burden_velocity: FloatArray
    powder_factor: FloatArray
    venting_time: FloatArray
    vented_fraction: FloatArray
    collar_fraction: FloatArray
    ejection_time: FloatArray
    acceleration_time: FloatArray
    acceleration_distance: FloatArray
    motion_time: FloatArray
    burden_kinetic_energy: FloatArray
    fracture_work: FloatArray
    stemming_work: FloatArray
    vented_enthalpy: FloatArray
    atmospheric_work: FloatArray
    floor_work: FloatArray
    initial_gas_energy: FloatArray
    final_gas_energy: FloatArray
    burden_energy_residual: FloatArray
    mass_residual: FloatArray
    n_steps: IntArray
