r"""Lagrangian mesh of the annulus and the kernels that move it by one step.

Plane strain, axial symmetry, large strain (staggered scheme of the kind of Wilkins 1964 and
FLAC). Nodes carry radius and velocity, zones between them carry stress; everything is per radian
and per metre of hole. With width w = r2 - r1 and mean radius m = (r1 + r2) / 2 of a zone

    area m w (exact),  log strains  ln(w / w0), ln(m / m0),  J = m w / (m0 w0)
    forces by virtual work:  on node 1  + s_r m - s_h w / 2,   on node 2  - s_r m - s_h w / 2

so that the discrete forces are the exact gradient of the discrete energy.

**Stress measure.** The stress kept is the Kirchhoff stress tau = J sigma, linear in the elastic
logarithmic strain (Hencky): a hyperelastic law, so the elastic energy is a function of state and
the energy ledger closes up to the error of time integration. The Cauchy stress with logarithmic
increments would not conserve energy at the elastic strains next to a hole at several GPa.
Strengths are those of the Cauchy stress, tau is compared with J times them. The return is made
on logarithmic strains, whose elastic and plastic parts add because the axes never turn.

**Artificial viscosity** (von Neumann & Richtmyer 1950; Landshoff 1955; Wilkins 1980) is a
pressure q in zones that are being compressed,

    q = rho w (C_Q w d^2 + C_L c d),   d = -(volumetric strain rate) > 0.

The quadratic part acts everywhere. The linear part acts where the rock has yielded in shear: it
is part of the model there, because non-associated flow with sin(phi) > 1 - 2 nu is unstable
without it (Sandler & Rubin 1987), whereas in elastic rock it would only eat the outgoing wave.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from castblast.kernel import kernel
from castblast.nearfield.mohr_coulomb import YieldModel, is_elastic, return_to_yield

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]

# Bits of `Body.history`: what has happened in a zone.
SHEAR_YIELD = 1
TENSILE_YIELD = 2
CRUSHED_UNDER_HOOP_COMPRESSION = 4

# Slots of the work ledger, per radian.
SHEAR, TENSION, VISCOUS, BOUNDARY, LOAD, RAMP = 0, 1, 2, 3, 4, 5
LEDGER_SIZE = 6


class Material(NamedTuple):
    """Constants of the rock in the form the kernels use.

    Attributes
    ----------
    density : float [kg m-3]
    bulk_modulus, shear_modulus : float [Pa]
    ucs, tension : float [Pa]
        Strengths; `tension` at most at the apex of the cone.
    brittle : bool
        Tensile strength is lost at the first tensile yield.
    quadratic_viscosity, linear_viscosity : float [-]
    viscous_everywhere : bool
        Linear viscosity in elastic zones too.
    """

    density: float
    bulk_modulus: float
    shear_modulus: float
    ucs: float
    tension: float
    brittle: bool
    quadratic_viscosity: float
    linear_viscosity: float
    viscous_everywhere: bool


class Body(NamedTuple):
    """State of the annulus: n zones, n + 1 nodes; arrays are changed in place.

    Attributes
    ----------
    initial_radius, mass, radius, velocity, force : array (n + 1,) [m, kg, m, m/s, N; per radian]
    initial_area, width, mean_radius : array (n,) [m2, m, m]
    radial, hoop, axial : array (n,) [Pa]
        Kirchhoff stress, tension positive.
    viscous : array (n,) [Pa]
        Viscous pressure of the last step.
    tension : array (n,) [Pa]
        Present tensile strength.
    shear_multiplier : array (n,) [-]
        Sum of the plastic shear multiplier of the most compressive direction.
    shear_strain : array (n,) [-]
        Integral of sqrt(2/3 de:de) of plastic shear flow.
    history : int array (n,)
        Bits of what has happened.
    """

    initial_radius: FloatArray
    mass: FloatArray
    radius: FloatArray
    velocity: FloatArray
    force: FloatArray
    initial_area: FloatArray
    width: FloatArray
    mean_radius: FloatArray
    radial: FloatArray
    hoop: FloatArray
    axial: FloatArray
    viscous: FloatArray
    tension: FloatArray
    shear_multiplier: FloatArray
    shear_strain: FloatArray
    history: IntArray


@kernel
def graded_radii(inner: float, outer: float, zones: int, first: float) -> FloatArray:
    """Node radii of a mesh whose zones grow by a constant factor.

    Parameters
    ----------
    inner, outer : float [m]
    zones : int
    first : float [m]
        Width of the first zone; a uniform mesh if it would not fit otherwise.

    Returns
    -------
    array (zones + 1,) [m]
    """
    length = outer - inner
    nodes = np.empty(zones + 1)
    if first * zones >= length:
        for i in range(zones + 1):
            nodes[i] = inner + length * i / zones
        return nodes
    # Bisection for the ratio of (ratio^zones - 1) / (ratio - 1) = length / first.
    low, high = 1.0 + 1e-12, 4.0
    for _ in range(100):
        ratio = 0.5 * (low + high)
        if np.expm1(zones * np.log(ratio)) / (ratio - 1.0) > length / first:
            high = ratio
        else:
            low = ratio
    growth = np.log(0.5 * (low + high))
    for i in range(zones + 1):
        nodes[i] = inner + length * np.expm1(i * growth) / np.expm1(zones * growth)
    return nodes


@kernel
def make_body(nodes: FloatArray, material: Material, in_situ_stress: float) -> Body:
    """Rock at rest under an isotropic in-situ compression [Pa] on the given node radii [m]."""
    n = nodes.size - 1
    width = nodes[1:] - nodes[:-1]
    mean = 0.5 * (nodes[1:] + nodes[:-1])
    area = width * mean
    mass = np.zeros(n + 1)
    mass[:-1] += 0.5 * material.density * area
    mass[1:] += 0.5 * material.density * area
    stress = np.full(n, -in_situ_stress)
    return Body(
        nodes.copy(),
        mass,
        nodes.copy(),
        np.zeros(n + 1),
        np.zeros(n + 1),
        area,
        width,
        mean,
        stress.copy(),
        stress.copy(),
        stress.copy(),
        np.zeros(n),
        np.full(n, material.tension),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n, dtype=np.int64),
    )


@kernel
def _log_ratio(new: float, old: float) -> float:
    """ln(new / old) for the small change of one step (error below 1e-11 at 1 percent)."""
    z = (new - old) / (new + old)
    z2 = z * z
    return 2.0 * z * (1.0 + z2 * (1.0 / 3.0 + 0.2 * z2))


@kernel
def update_stress(
    body: Body,
    j: int,
    radial_strain: float,
    hoop_strain: float,
    material: Material,
    model: YieldModel,
    work: FloatArray,
) -> bool:
    """Add strain increments to zone `j`, return its stress to strength, book the plastic work.

    Plastic work is the mean of old and new stress times the plastic strain: for a quadratic
    elastic energy this makes elastic plus plastic work equal to the work of the mean stress.
    Returns True if the return found no admissible stress.
    """
    lame = model.stiffness - 2.0 * material.shear_modulus
    pressure_part = lame * (radial_strain + hoop_strain)
    old_r, old_h, old_a = body.radial[j], body.hoop[j], body.axial[j]
    trial_r = old_r + pressure_part + 2.0 * material.shear_modulus * radial_strain
    trial_h = old_h + pressure_part + 2.0 * material.shear_modulus * hoop_strain
    trial_a = old_a + pressure_part
    swelling = body.width[j] * body.mean_radius[j] / body.initial_area[j]
    ucs = swelling * material.ucs
    tension = swelling * body.tension[j]
    if is_elastic(model, trial_r, trial_h, trial_a, ucs, tension):
        body.radial[j], body.hoop[j], body.axial[j] = trial_r, trial_h, trial_a
        return False
    s = return_to_yield(model, trial_r, trial_h, trial_a, ucs, tension)
    body.radial[j], body.hoop[j], body.axial[j] = s.radial, s.hoop, s.axial
    mean_r, mean_h, mean_a = 0.5 * (old_r + s.radial), 0.5 * (old_h + s.hoop), 0.5 * (old_a + s.axial)
    area = body.initial_area[j]
    if s.multiplier > 0.0:
        p_r, p_h, p_a = s.shear_radial, s.shear_hoop, s.shear_axial
        work[SHEAR] += area * (mean_r * p_r + mean_h * p_h + mean_a * p_a)
        body.shear_multiplier[j] += s.multiplier
        body.shear_strain[j] += np.sqrt(2.0 / 3.0 * (p_r * p_r + p_h * p_h + p_a * p_a))
        body.history[j] |= SHEAR_YIELD
        if s.hoop < -1e-6 * ucs:
            body.history[j] |= CRUSHED_UNDER_HOOP_COMPRESSION
    opening = s.tensile_radial + s.tensile_hoop + s.tensile_axial
    if opening > 0.0:
        work[TENSION] += area * (
            mean_r * s.tensile_radial + mean_h * s.tensile_hoop + mean_a * s.tensile_axial
        )
        body.history[j] |= TENSILE_YIELD
        if material.brittle:
            body.tension[j] = 0.0
    return s.fallback


@kernel
def update_zones(
    body: Body, active: int, dt: float, material: Material, model: YieldModel, work: FloatArray
) -> tuple[float, int]:
    """Strain, stress, viscosity and nodal forces of the first `active` zones after a move.

    Returns
    -------
    limit : float [s]
        Largest stable step of the new state; negative if a zone has turned inside out.
    fallbacks : int
        Zones whose stress return failed.
    """
    limit = np.inf
    fallbacks = 0
    radius, force = body.radius, body.force
    force[: active + 1] = 0.0
    for j in range(active):
        width = radius[j + 1] - radius[j]
        mean = 0.5 * (radius[j + 1] + radius[j])
        if not (width > 0.0 and radius[j] > 0.0):
            return -1.0, fallbacks
        old_width, old_mean = body.width[j], body.mean_radius[j]
        radial_strain = _log_ratio(width, old_width)
        hoop_strain = _log_ratio(mean, old_mean)
        body.width[j], body.mean_radius[j] = width, mean
        if update_stress(body, j, radial_strain, hoop_strain, material, model, work):
            fallbacks += 1
        swelling = width * mean / body.initial_area[j]
        # Tangent of the Kirchhoff law seen by the nodes: radial compression stiffens it.
        speed = np.sqrt((model.stiffness + abs(body.radial[j])) / material.density)
        viscosity = 0.0
        viscous = 0.0
        rate = -(radial_strain + hoop_strain) / dt
        if rate > 0.0:
            viscosity = material.quadratic_viscosity * width * rate / speed
            if material.viscous_everywhere or body.history[j] & SHEAR_YIELD:
                viscosity += material.linear_viscosity
            viscous = material.density / swelling * width * speed * viscosity * rate
        limit = min(limit, width / speed * (np.sqrt(1.0 + viscosity * viscosity) - viscosity))
        # Work of q on the exact change of area, split as the two half kicks of the nodes see it.
        d_width, d_mean = width - old_width, mean - old_mean
        work[VISCOUS] -= 0.5 * (
            body.viscous[j] * (old_mean * d_width + old_width * d_mean)
            + viscous * (mean * d_width + width * d_mean)
        )
        body.viscous[j] = viscous
        through = (body.radial[j] / swelling - viscous) * mean
        around = 0.5 * (body.hoop[j] / swelling - viscous) * width
        force[j] += through - around
        force[j + 1] -= through + around
    return limit, fallbacks


@kernel
def kinetic_energy(body: Body, half_kick: float) -> float:
    """Kinetic energy per radian [J/m]; `half_kick` [s] brings the velocities to the present."""
    total = 0.0
    for i in range(body.mass.size):
        speed = body.velocity[i] + half_kick * body.force[i] / body.mass[i]
        total += 0.5 * body.mass[i] * speed * speed
    return total


@kernel
def elastic_energy(body: Body, material: Material) -> float:
    """Elastic energy per radian [J/m] from the state: area0 (s:s / 2G - nu' tr^2 ...) / 2."""
    total = 0.0
    for j in range(body.radial.size):
        mean = (body.radial[j] + body.hoop[j] + body.axial[j]) / 3.0
        d_r, d_h, d_a = body.radial[j] - mean, body.hoop[j] - mean, body.axial[j] - mean
        density = mean * mean / (2.0 * material.bulk_modulus) + (
            d_r * d_r + d_h * d_h + d_a * d_a
        ) / (4.0 * material.shear_modulus)
        total += body.initial_area[j] * density
    return total
