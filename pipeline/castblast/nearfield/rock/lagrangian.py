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

**Viscosity** is a pressure in three parts, with c the p-wave speed, d = -(volumetric strain rate)
and d- and d+ the same in the zones on either side:

    q = rho c l C_L d  +  rho w^2 C_Q j^2  +  rho c w C_N (d - (d- + d+) / 2)

*Shocks* (von Neumann & Richtmyer 1950) are spread by the quadratic part. It sees only the jump
j = max(d - s, 0), where s = max(0, min(2 d-, 2 d+, (d- + d+) / 2, d)) is what a smooth compression
would be (Christensen 1990; Caramana, Shashkov & Whalen 1998). *Grid noise* is damped by the last
part, which vanishes on every field that is smooth over three zones and works in compression and
expansion alike. Both go with the width of a zone: refining the mesh refines them.

The *linear* part (Landshoff 1955) belongs to the model, over a physical length l = 0.04 r that no
mesh changes: with sin(phi) > 1 - 2 nu the non-associated flow is unstable without it (Sandler &
Rubin 1987) and weak rock has no answer that meshes agree on. Measured at phi 53 degrees, nu 0.25,
UCS 11 MPa, E 24 GPa (144, 288, 576, 1,152 zones; equilibrium pressure in MPa): without it 89.7,
90.5, 87.2, 87.1; with C_L 0.15: 87.24, 87.26, 87.26, 87.26. It acts in expansion too, because the
instability oscillates, and it is a share of the radius, so geometric similarity is kept. The price:
outgoing waves are damped, so kinetic and elastic energy at the end are too low by what
`viscous_work` is too high; their sum, the radiated share, is converged. Rock that yields in the
wave front itself must not have it and does not: see `castblast.nearfield.front`.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from castblast.kernel import fused_kernel, inline_kernel, kernel
from castblast.nearfield.rock.ledger import SHEAR, TENSION, VISCOUS
from castblast.nearfield.rock.mohr_coulomb import YieldModel, edge_return
from castblast.nearfield.rock.zone import (
    Flow,
    Squeeze,
    Stress,
    Viscosity,
    deform,
    edge_flow,
    elastic,
    extent,
    hoop_compressive,
    per_area_between,
    resist,
    squeeze_rate,
    try_one_plane,
    viscous_work,
)

FloatArray: TypeAlias = NDArray[np.float64]

#: Largest strain of a zone in one step; the work of a step is right to its square.
STRAIN_STEP = 0.0045


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
    initial_radius, mass, per_mass : array (n + 1,) [m, kg, 1/kg; per radian]
    radius, velocity, force : array (n + 1,) [m, m/s, N; per radian]
    initial_area, per_initial_area : array (n,) [m2, m-2]
    width, mean_radius : array (n,) [m]
    radial, hoop, axial : array (n,) [Pa]
        Kirchhoff stress, tension positive.
    viscous : array (n,) [Pa]
        Viscous pressure of the last step.
    tension : array (n,) [Pa]
        Present tensile strength.
    shear_multiplier, tensile_multiplier, hoop_multiplier : array (n,) [-]
        Sum of the plastic multiplier of the most compressive direction, of that of tension, and
        of the first one while the hoop stress was compressive; where a zone has never yielded so,
        minus the strain by which it fell short of it (see `castblast.nearfield.rock.zone.extent`).
    shear_strain : array (n,) [-]
        Integral of sqrt(2/3 de:de) of plastic shear flow.
    """

    initial_radius: FloatArray
    mass: FloatArray
    per_mass: FloatArray
    radius: FloatArray
    velocity: FloatArray
    force: FloatArray
    initial_area: FloatArray
    per_initial_area: FloatArray
    width: FloatArray
    mean_radius: FloatArray
    radial: FloatArray
    hoop: FloatArray
    axial: FloatArray
    viscous: FloatArray
    tension: FloatArray
    shear_multiplier: FloatArray
    tensile_multiplier: FloatArray
    hoop_multiplier: FloatArray
    shear_strain: FloatArray


@kernel
def graded_radii(
    inner: float, outer: float, zones: float, first: float, reach: float
) -> FloatArray:
    """Node radii of a mesh whose zones grow outwards, beyond a reach faster than within.

    With y the distance from the wall and i the number of a node, dy/di = (first + g y)
    (1 + y / reach), in closed form y = first E / (q - E first / reach) with E = exp(q i) - 1; q
    puts the last node on the outer radius. An infinite reach makes a geometric series.

    `zones` need not be whole: of 112.4 there are 112, graded as if 0.4 more followed, and the last
    one reaches to the outer radius. So all nodes but the last move smoothly with it.

    Parameters
    ----------
    inner, outer : float [m]
    zones : float
    first : float [m]
        Width of zones at the wall; a uniform mesh if it would not fit otherwise.
    reach : float [m]
        Distance from the wall over which the zones stay fine; may be infinite.

    Returns
    -------
    array (whole zones + 1,) [m]
    """
    length = outer - inner
    count = int(zones)
    nodes = np.empty(count + 1)
    nodes[count] = outer
    if first * (1.0 + length / reach) * zones >= length:
        for i in range(count):
            nodes[i] = inner + length * i / zones
        return nodes
    share = first / reach
    q = mesh_growth(length, zones, first, reach)
    for i in range(count):
        e = np.expm1(q * i)
        nodes[i] = inner + first * e / (q - share * e)
    return nodes


@kernel
def mesh_growth(length: float, zones: float, first: float, reach: float) -> float:
    """Growth q of `graded_radii` that puts the last node at `length` [m] from the wall."""
    share = first / reach
    low, high = 1e-12, 4.0
    for _ in range(100):
        q = 0.5 * (low + high)
        if np.expm1(q * zones) * (first + share * length) > q * length:
            high = q
        else:
            low = q
    return q


@kernel
def make_body(
    nodes: FloatArray, material: Material, model: YieldModel, in_situ_stress: float
) -> Body:
    """Rock at rest under an isotropic in-situ compression [Pa] on the given node radii [m]."""
    n = nodes.size - 1
    width = nodes[1:] - nodes[:-1]
    mean = 0.5 * (nodes[1:] + nodes[:-1])
    area = width * mean
    mass = np.zeros(n + 1)
    mass[:-1] += 0.5 * material.density * area
    mass[1:] += 0.5 * material.density * area
    stress = np.full(n, -in_situ_stress)
    planes = model.planes
    excess = (1.0 - planes.friction) * in_situ_stress - material.ucs
    never_sheared = np.full(n, min(planes.shear_compliance * excess, 0.0))
    never_opened = np.full(n, min((-in_situ_stress - material.tension) / planes.stiffness, 0.0))
    return Body(
        nodes.copy(),
        mass,
        1.0 / mass,
        nodes.copy(),
        np.zeros(n + 1),
        np.zeros(n + 1),
        area,
        1.0 / area,
        width,
        mean,
        stress.copy(),
        stress.copy(),
        stress.copy(),
        np.zeros(n),
        np.full(n, material.tension),
        never_sheared,
        never_opened,
        never_sheared.copy(),
        np.zeros(n),
    )


@kernel
def first_zones(body: Body, count: int) -> Body:
    """The body without the zones beyond the first `count`: views, nothing is copied."""
    n, b = count + 1, body
    return Body(
        b.initial_radius[:n], b.mass[:n], b.per_mass[:n], b.radius[:n], b.velocity[:n],
        b.force[:n], b.initial_area[:count], b.per_initial_area[:count], b.width[:count],
        b.mean_radius[:count], b.radial[:count], b.hoop[:count], b.axial[:count],
        b.viscous[:count], b.tension[:count], b.shear_multiplier[:count],
        b.tensile_multiplier[:count], b.hoop_multiplier[:count], b.shear_strain[:count],
    )  # fmt: skip


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
    # Members of a tuple of arrays are reference-counted at every access: name them once.
    radius, force, widths, means = body.radius, body.force, body.width, body.mean_radius
    radial, hoop, axial, viscous = body.radial, body.hoop, body.axial, body.viscous
    sheared, opened, crushed = body.shear_multiplier, body.tensile_multiplier, body.hoop_multiplier
    strain, tensions = body.shear_strain, body.tension
    areas, per_area = body.initial_area, body.per_initial_area
    velocity = body.velocity
    planes = model.planes
    viscosity = Viscosity(material.linear_viscosity, material.quadratic_viscosity)
    per_second = 1.0 / dt
    limit, fastest, fallbacks = np.inf, 0.0, 0
    force[0] = 0.0
    ahead = per_area_between(radius[0], radius[1])
    here = squeeze_rate(radius[0], radius[1], velocity[0], velocity[1], ahead)
    before = here
    for j in range(active):
        after, per_new_area = here, ahead
        if j + 1 < widths.size:
            ahead = per_area_between(radius[j + 1], radius[j + 2])
            after = squeeze_rate(
                radius[j + 1], radius[j + 2], velocity[j + 1], velocity[j + 2], ahead
            )
        old_width, old_mean, area = widths[j], means[j], areas[j]
        d = deform(radius[j], radius[j + 1], per_new_area, old_width, old_mean)
        old = Stress(radial[j], hoop[j], axial[j])
        trial = elastic(planes, d, old)
        swelling = d.width * d.mean * per_area[j]
        one = try_one_plane(planes, trial, old, swelling, material.ucs, tensions[j])
        flow = one.flow
        if not one.solved:
            flow, failed = _edge(model, trial, old, one.ucs, one.tension)
            fallbacks += failed
        stress = flow.stress
        radial[j], hoop[j], axial[j] = stress.radial, stress.hoop, stress.axial
        widths[j], means[j] = d.width, d.mean
        sheared[j] = extent(sheared[j], flow.shear, one.shear_shortfall)
        opened[j] = extent(opened[j], flow.opening, one.tensile_shortfall)
        if hoop_compressive(stress, one.ucs):
            crushed[j] = extent(crushed[j], flow.shear, one.shear_shortfall)
        strain[j] += flow.strain
        tensions[j] = after_opening(material.brittle, flow.opening, tensions[j])
        r = resist(
            d, stress, per_second, Squeeze(before, here, after), planes.stiffness,
            material.density, viscosity, area, radius[j],
        )  # fmt: skip
        work[SHEAR] += area * flow.shear_work
        work[TENSION] += area * flow.tensile_work
        work[VISCOUS] += viscous_work(d, old_width, old_mean, viscous[j], r.viscous)
        viscous[j] = r.viscous
        limit = min(limit, r.limit)
        fastest = max(fastest, max(abs(d.radial), abs(d.hoop)))
        force[j] += r.through - r.around
        force[j + 1] = -r.through - r.around
        before, here = here, after
    return step_limit(limit, fastest, dt), fallbacks


@kernel
def _edge(
    model: YieldModel, trial: Stress, old: Stress, ucs: float, tension: float
) -> tuple[Flow, int]:
    """Flow of a zone that one plane cannot return, and 1 if no set of planes could."""
    s = edge_return(model, trial.radial, trial.hoop, trial.axial, ucs, tension)
    return edge_flow(s, old), 1 if s.fallback else 0


@fused_kernel
def after_opening(brittle: bool, opening: float, tension: float) -> float:
    """Tensile strength [Pa] left after a step."""
    return 0.0 if brittle and opening > 0.0 else tension


@inline_kernel
def step_limit(limit: float, fastest: float, dt: float) -> float:
    """Largest next step [s] from the wave speed and from the largest strain of the last step."""
    return STRAIN_STEP * dt / fastest if fastest * limit > STRAIN_STEP * dt else limit


@kernel
def kinetic_energy(body: Body, active: int, half_kick: float) -> float:
    """Kinetic energy per radian [J/m] of the nodes in motion.

    `half_kick` [s] brings their velocities to the present; that of the outermost node, on which a
    boundary acts besides, is taken as it is.
    """
    total = 0.0
    for i in range(active):
        speed = body.velocity[i] + half_kick * body.force[i] * body.per_mass[i]
        total += 0.5 * body.mass[i] * speed * speed
    if active == body.width.size:
        total += 0.5 * body.mass[active] * body.velocity[active] ** 2
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
