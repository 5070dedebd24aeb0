"""Zones that merge behind the wave front: what is kept, what is booked, what stays apart."""

import numpy as np
import pytest
from near_field_problems import ANFO, base_hole, rock

from castblast.nearfield import solver
from castblast.nearfield.case import NearFieldSettings
from castblast.nearfield.march import march
from castblast.nearfield.rock.body_merging import merge_body
from castblast.nearfield.rock.lagrangian import Body, Material, elastic_energy, make_body
from castblast.nearfield.rock.ledger import LEDGER_SIZE, VISCOUS
from castblast.nearfield.rock.merging import Coarse, Passed
from castblast.nearfield.rock.mohr_coulomb import make_yield_model

MATERIAL = Material(2500.0, 1.2e10, 8e9, 6e7, 5e6, False, 1.5, 0.0)
MODEL = make_yield_model(MATERIAL.bulk_modulus, MATERIAL.shear_modulus, 3.5, 1.2)
LAG = 1e-6
ANY_WIDTH = Coarse(first=1e9, growth=0.0, reach=np.inf)


def moving_body(zones: int) -> Body:
    """Rock in motion under a stress that varies from zone to zone."""
    rng = np.random.default_rng(zones)
    nodes = np.linspace(1.0, 3.0, zones + 1)
    body = make_body(nodes, MATERIAL, MODEL, 1e6)
    body.radius[:] = nodes + 0.01 * np.cos(nodes)
    body.velocity[:] = 5.0 + rng.normal(size=zones + 1)
    for stress in (body.radial, body.hoop, body.axial):
        stress[:] = -1e7 + 1e6 * rng.normal(size=zones)
    body.width[:] = np.diff(body.radius)
    body.mean_radius[:] = 0.5 * (body.radius[1:] + body.radius[:-1])
    _pull(body)
    return body


def _pull(body: Body) -> None:
    """Nodal forces by virtual work, without viscosity."""
    shrinking = body.initial_area / (body.width * body.mean_radius)
    through = body.radial * shrinking * body.mean_radius
    around = 0.5 * body.hoop * shrinking * body.width
    body.force[:] = 0.0
    body.force[:-1] += through - around
    body.force[1:] -= through + around


def merge(body: Body, passed: Passed, active: int) -> tuple[Body, float]:
    """Merge to any width; the body that is left and the energy booked."""
    work = np.zeros(LEDGER_SIZE)
    origin = np.arange(body.radius.size)
    left, _ = merge_body(
        body, origin, active, ANY_WIDTH, passed, LAG, 0.0, MATERIAL.density, MODEL.planes, work
    )
    return left, float(work[VISCOUS])


def kinetic(body: Body) -> float:
    """Energy of motion as a leapfrog keeps it, of all nodes but the outermost."""
    v, f, m = body.velocity[:-1], body.force[:-1], body.mass[:-1]
    return float(np.sum(0.5 * m * v * (v + 2.0 * LAG * f / m)))


TURNED = Passed(wall=1.0, front=1e9, turned=True)


def test_merging_keeps_mass_and_area_and_books_the_energy_it_takes() -> None:
    body = moving_body(64)
    area, moved = body.initial_area.sum(), body.width @ body.mean_radius
    outermost = body.mass[-1]
    mass = body.mass[:-1].sum()
    energy = kinetic(body) + elastic_energy(body, MATERIAL)
    left, booked = merge(body, TURNED, 64)
    assert left.width.size < 40
    assert left.initial_area.sum() == pytest.approx(area, rel=1e-14)
    assert left.width @ left.mean_radius == pytest.approx(moved, rel=1e-14)
    # The outermost zone never merges and its node keeps the mass it had.
    assert left.mass[-1] == outermost
    assert left.mass[:-1].sum() == pytest.approx(mass, rel=1e-14)
    assert booked > 0.0
    assert energy - kinetic(left) - elastic_energy(left, MATERIAL) == pytest.approx(
        booked, rel=1e-10
    )


def test_equal_stress_and_even_motion_lose_nothing_to_their_mean() -> None:
    body = moving_body(64)
    for stress in (body.radial, body.hoop, body.axial):
        stress[:] = -1e7
    body.velocity[:] = 5.0
    body.radius[:] = body.initial_radius
    body.width[:] = np.diff(body.radius)
    body.mean_radius[:] = 0.5 * (body.radius[1:] + body.radius[:-1])
    _pull(body)
    energy = elastic_energy(body, MATERIAL)
    left, booked = merge(body, TURNED, 64)
    assert left.width.size < 64
    assert elastic_energy(left, MATERIAL) == pytest.approx(energy, rel=1e-13)
    assert abs(booked) < 1e-4 * kinetic(left)


def test_zones_ahead_of_the_wave_and_of_unlike_strength_stay_apart() -> None:
    body = moving_body(128)
    nodes = body.initial_radius.copy()
    left, _ = merge(body, Passed(wall=1.0, front=2.0, turned=False), 128)
    kept = left.initial_radius[left.initial_radius > 1.7]
    np.testing.assert_array_equal(kept, nodes[nodes > 1.7])
    assert left.width.size < 128
    body = moving_body(64)
    body.tension[::2] = 0.0
    left, booked = merge(body, TURNED, 64)
    assert (left.width.size, booked) == (64, 0.0)


@pytest.mark.parametrize("friction_angle", [28.0, 45.0])
def test_merging_moves_the_end_state_by_a_few_parts_in_a_thousand(friction_angle: float) -> None:
    """Against the same zones kept to the end; the first rock yields in the front, I = 0.92."""
    of = rock(friction_angle=friction_angle)
    case = solver._annulus(ANFO, of, base_hole(), NearFieldSettings())
    merged, kept = march(case), march(case._replace(coarse=case.coarse._replace(first=0.0)))
    assert merged.zone_steps < 0.2 * kept.zone_steps
    assert merged.body.radius[0] == pytest.approx(kept.body.radius[0], rel=1e-3)
