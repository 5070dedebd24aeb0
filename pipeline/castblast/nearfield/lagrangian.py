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

**Viscosity** (von Neumann & Richtmyer 1950; Landshoff 1955; Wilkins 1980) is a pressure

    q = rho c l C_L d + rho w^2 C_Q d^2 (only where d > 0),   d = -(volumetric strain rate)

with c the p-wave speed and l = max(w, 0.04 r). The quadratic part spreads shocks. The linear part
belongs to the model: with sin(phi) > 1 - 2 nu the non-associated flow is unstable without it
(Sandler & Rubin 1987) and refinement makes the answer worse. The instability oscillates, so the
linear part must act in expansion as well as in compression; and only with a length that does not
shrink with the zones is there a solution for the mesh to converge to. Measured on rock with
phi 53 degrees, nu 0.25, UCS 11 MPa, E 24 GPa (120, 240, 480 zones; equilibrium pressure in MPa):
compression only, l = w: 51.7, 52.2, 53.3, diverging; both signs, l = max(w, 0.04 r), C_L 0.3:
54.96, 54.97, 54.98. The length changes the pressure by less than 0.1 percent in strong rock and by
about 1 percent in the weakest (C_L 0.15 against 0.3). It is a share of the radius, so geometric
similarity is kept. The price: outgoing waves are damped, so kinetic and elastic energy at the end
are too low by what `viscous_work` is too high; their sum, the radiated share, is converged.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from castblast.kernel import kernel
from castblast.nearfield.mohr_coulomb import YieldModel, return_to_yield

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]

# Bits of `Body.history`: what has happened in a zone.
SHEAR_YIELD = 1
TENSILE_YIELD = 2
CRUSHED_UNDER_HOOP_COMPRESSION = 4

# Slots of the work ledger, per radian.
SHEAR, TENSION, VISCOUS, BOUNDARY, LOAD, RAMP = 0, 1, 2, 3, 4, 5
LEDGER_SIZE = 6


#: The linear viscosity acts over at least this share of the radius, on however fine a mesh.
VISCOUS_LENGTH = 0.04
#: Largest strain of a zone in one step; the work of a step is right to its square.
STRAIN_STEP = 0.01


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
    """

    density: float
    bulk_modulus: float
    shear_modulus: float
    ucs: float
    tension: float
    brittle: bool
    quadratic_viscosity: float
    linear_viscosity: float


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
def _equivalent(radial: float, hoop: float, axial: float) -> float:
    """Equivalent strain sqrt(2/3 e:e) of principal strains."""
    return float(np.sqrt(2.0 / 3.0 * (radial * radial + hoop * hoop + axial * axial)))


@kernel
def update_zones(
    body: Body, active: int, dt: float, material: Material, model: YieldModel, work: FloatArray
) -> tuple[float, int]:
    """Strain, stress, viscosity and nodal forces of the first `active` zones after a move.

    Plastic work is the mean of old and new stress times the plastic strain: for a quadratic
    elastic energy this makes elastic plus plastic work equal to the work of the mean stress.

    Returns
    -------
    limit : float [s]
        Largest stable step of the new state; negative if a zone has turned inside out.
    fallbacks : int
        Zones whose stress return failed.
    """
    # Members of a tuple of arrays are reference-counted at every access: name them once.
    radius, force, widths, means = body.radius, body.force, body.width, body.mean_radius
    radial, hoop, axial, viscous = body.radial, body.hoop, body.axial, body.viscous
    multiplier, strain = body.shear_multiplier, body.shear_strain
    areas, tensions, history = body.initial_area, body.tension, body.history
    lame, shear2 = model.lame, model.twice_shear
    limit = np.inf
    fastest = 0.0
    per_second = 1.0 / dt
    fallbacks = 0
    force[: active + 1] = 0.0
    for j in range(active):
        width = radius[j + 1] - radius[j]
        mean = 0.5 * (radius[j + 1] + radius[j])
        if not (width > 0.0 and radius[j] > 0.0):
            return -1.0, fallbacks
        old_width, old_mean, area = widths[j], means[j], areas[j]
        radial_strain = _log_ratio(width, old_width)
        hoop_strain = _log_ratio(mean, old_mean)
        volume_strain = radial_strain + hoop_strain
        widths[j], means[j] = width, mean
        swelling = width * mean / area
        shrinking = 1.0 / swelling
        # Elastic trial; the return keeps it where it is admissible.
        tau_r = radial[j] + lame * volume_strain + shear2 * radial_strain
        tau_h = hoop[j] + lame * volume_strain + shear2 * hoop_strain
        tau_a = axial[j] + lame * volume_strain
        ucs, tension = swelling * material.ucs, swelling * tensions[j]
        least, most = max(tau_r, tau_h, tau_a), min(tau_r, tau_h, tau_a)
        if model.friction * least - most > ucs or least > tension:
            s = return_to_yield(model, tau_r, tau_h, tau_a, ucs, tension)
            tau_r, tau_h, tau_a = s.radial, s.hoop, s.axial
            mean_r = 0.5 * area * (radial[j] + tau_r)
            mean_h = 0.5 * area * (hoop[j] + tau_h)
            mean_a = 0.5 * area * (axial[j] + tau_a)
            work[SHEAR] += mean_r * s.shear_radial + mean_h * s.shear_hoop + mean_a * s.shear_axial
            work[TENSION] += (
                mean_r * s.tensile_radial + mean_h * s.tensile_hoop + mean_a * s.tensile_axial
            )
            multiplier[j] += s.multiplier
            strain[j] += _equivalent(s.shear_radial, s.shear_hoop, s.shear_axial)
            if s.multiplier > 0.0:
                history[j] |= SHEAR_YIELD
                if s.hoop < -1e-6 * ucs:
                    history[j] |= CRUSHED_UNDER_HOOP_COMPRESSION
            if s.tensile_radial + s.tensile_hoop + s.tensile_axial > 0.0:
                history[j] |= TENSILE_YIELD
                if material.brittle:
                    tensions[j] = 0.0
            if s.fallback:
                fallbacks += 1
        radial[j], hoop[j], axial[j] = tau_r, tau_h, tau_a
        # Tangent of the Kirchhoff law seen by the nodes: radial compression stiffens it.
        modulus = model.stiffness + abs(tau_r)
        transit = width * np.sqrt(material.density / modulus)
        rate = -volume_strain * per_second
        damping = material.linear_viscosity * max(1.0, VISCOUS_LENGTH * mean / width)
        if rate > 0.0:
            damping += material.quadratic_viscosity * transit * rate
        pressure = modulus * transit * damping * rate * shrinking
        limit = min(limit, transit * (np.sqrt(1.0 + damping * damping) - damping))
        fastest = max(fastest, abs(radial_strain), abs(hoop_strain))
        # Work of q on the exact change of area, split as the two half kicks of the nodes see it.
        d_width, d_mean = width - old_width, mean - old_mean
        work[VISCOUS] -= 0.5 * (
            viscous[j] * (old_mean * d_width + old_width * d_mean)
            + pressure * (mean * d_width + width * d_mean)
        )
        viscous[j] = pressure
        through = (tau_r * shrinking - pressure) * mean
        around = 0.5 * (tau_h * shrinking - pressure) * width
        force[j] += through - around
        force[j + 1] -= through + around
    if fastest * limit > STRAIN_STEP * dt:
        limit = STRAIN_STEP * dt / fastest
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
