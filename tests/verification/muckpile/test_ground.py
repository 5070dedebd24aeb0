"""Triangulated ground: a ball must feel the surface, not its facets.

A flat mesh must give what the plane gives, wherever the ball comes down; a groove must give what
two planes give; a ridge must turn a ball as a round edge does. Common data: radius 0.1 m, the law's
defaults, so that k_n = pi R E* = 3.1416 MN/m.
"""

from __future__ import annotations

from math import cos, pi, radians, sin, tan

import numpy as np
import pytest

from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.balls.particles import ball_mass, particles_at_rest
from castblast.muckpile.cast.case import CastCase
from castblast.muckpile.cast.solver import run_cast
from castblast.muckpile.engine.simulation import Simulation
from castblast.muckpile.engine.threads import thread_count
from castblast.muckpile.ground.terrain import heightmap, surface_faults
from castblast.muckpile.ground.walls import Walls, floor, join, plane, surface

R, G = 0.1, 9.81
LAW = ContactLaw()
M = float(ball_mass(np.array([R]), LAW.density)[0])
KN = pi * R * LAW.effective_modulus


@pytest.fixture(autouse=True)
def _one_thread():
    """A single ball gives a second thread nothing to do but to wait."""
    with thread_count(1):
        yield


PLACES = np.arange(-1.0, 1.01, 0.25)


def flat(height=0.0, angle=0.0) -> Walls:
    """Mesh of 0.25 m over 2 m by 2 m, rising with x at `angle`."""
    rise = height + tan(angle) * PLACES
    return heightmap(PLACES, PLACES, np.tile(rise, (len(PLACES), 1)))


def simulate(walls, position, velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0), law=LAW, step=0.0):
    position = np.atleast_2d(np.asarray(position, float))
    balls = particles_at_rest(position, np.full(len(position), R))
    balls.velocity[:] = velocity
    balls.angular_velocity[:] = spin
    held = np.zeros(len(position), dtype=bool)
    return Simulation(balls, law, walls, held, gravity=G, time_step=step)


def outcome(walls, *args, until=0.4, **kwargs):
    run = simulate(walls, *args, **kwargs)
    run.run(until, until)
    state = run.state()
    return np.hstack([state.position, state.velocity, state.angular_velocity])


def places_on_a_mesh(count=60):
    """Places in plan on corners, on edges, very close to them, and anywhere; 1.5 m apart."""
    rng = np.random.default_rng(3)
    anywhere = rng.uniform(0.0, 0.25, (count, 2))
    corners = np.zeros((12, 2))
    edges = np.column_stack([np.zeros(12), rng.uniform(0.0, 0.25, 12)])
    diagonal = np.repeat(rng.uniform(0.0, 0.25, 12)[:, None], 2, axis=1)
    beside = corners + rng.choice([-1e-9, 1e-9, 1e-16, 1e-12], (12, 2))
    local = np.vstack([anywhere, corners, edges, edges[:, ::-1], diagonal, beside])
    return local + 1.5 * np.column_stack(np.divmod(np.arange(len(local)), 11)) + 0.5


@pytest.mark.parametrize("velocity", [(0.0, 0.0, -2.0), (1.5, -0.7, -1.0)])
def test_rebound_from_a_flat_mesh_is_that_from_the_plane_everywhere(velocity):
    """Corners, edges and facets: position, velocity and spin after oblique impacts, to 1e-9."""
    plan = places_on_a_mesh()
    start = np.column_stack([plan, np.full(len(plan), R + 0.02)])
    grid = np.arange(0.0, 17.6, 0.25)
    mesh = heightmap(grid, grid, np.zeros((len(grid), len(grid))))
    on_mesh = outcome(mesh, start, velocity, until=0.2)
    on_plane = outcome(floor(), start, velocity, until=0.2)
    np.testing.assert_allclose(on_mesh, on_plane, atol=1e-9)
    # They did rebound.
    assert (on_plane[:, 2] > R).all()


@pytest.mark.parametrize("apart", [1e-12, 1e-6, 2e-4])
def test_rebound_where_the_corners_of_neighbours_do_not_quite_meet(apart):
    """Dropped at 3 m/s over a facet, a diagonal, an edge and a corner: 1.08 m/s as from a plane.

    Two facets that only lie side by side would both push, and 0.53 m/s would be left.
    """
    corner = flat().corner.copy()
    corner[:, :, :2] += np.random.default_rng(0).uniform(-apart, apart, corner[:, :, :2].shape)
    plan = [(-0.69, -0.61), (0.6, -0.65), (-0.5, 0.61), (0.5, 0.5)]
    start = [(*place, 0.3) for place in plan]
    loose = outcome(surface(corner), start, (0.0, 0.0, -3.0), until=0.15)
    on_plane = outcome(floor(), start, (0.0, 0.0, -3.0), until=0.15)
    np.testing.assert_allclose(loose, on_plane, atol=1e-6)
    np.testing.assert_allclose(loose[:, 5], 1.0754, atol=2e-4)


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.25, 0.1), (0.13, 0.13), (0.2, 0.07)])
def test_a_ball_rests_on_a_mesh_as_deep_as_on_a_plane(place):
    """D = m g/k_n on a corner, an edge, a diagonal and a facet."""
    end = outcome(flat(), (*place, R), until=1.0)[0]
    assert R - end[2] == pytest.approx(M * G / KN, rel=1e-6)
    np.testing.assert_allclose(end[:2], place, atol=1e-12)


def test_sliding_and_rolling_over_coplanar_edges_has_no_kick():
    """A ball thrown along the mesh, across edges and corners: the plane's path, to 1e-9."""
    for velocity, spin in (((2.0, 0.0, 0.0), (0.0, 0.0, 0.0)), ((1.5, 1.5, 0.0), (-9.0, 9.0, 0.0))):
        start = (-0.75, -0.75, R - M * G / KN)
        on_mesh = outcome(flat(), start, velocity, spin, until=0.6)
        on_plane = outcome(floor(), start, velocity, spin, until=0.6)
        np.testing.assert_allclose(on_mesh, on_plane, atol=1e-9)


@pytest.mark.parametrize(("degrees", "rolls"), [(16.0, False), (17.5, True)])
def test_rolling_threshold_on_an_inclined_mesh(degrees, rolls):
    """Tan(theta) = mu_r: 16.699 degrees for 0.3, on facets whose corners are rounded numbers."""
    angle = radians(degrees)
    law = LAW._replace(rolling_friction=0.3)
    normal = np.array([-sin(angle), 0.0, cos(angle)])
    start = np.array([0.6, 0.1, 0.6 * tan(angle)]) + normal * (R - M * G * cos(angle) / KN)
    end = outcome(flat(angle=angle), start, until=0.8, law=law)[0]
    way = np.linalg.norm(end[:3] - start)
    assert way > 0.02 if rolls else way < 1e-3
    same = outcome(plane((0, 0, 0), normal), start, until=0.8, law=law)[0]
    np.testing.assert_allclose(end, same, atol=1e-9)


def test_heights_of_a_slope_are_the_slope():
    """A heightmap of z = x tan(30 deg): a rolling and sliding ball follows the plane's path."""
    angle = radians(30.0)
    normal = np.array([-sin(angle), 0.0, cos(angle)])
    start = np.array([0.7, 0.03, 0.7 * tan(angle)]) + normal * (R + 0.01)
    on_mesh = outcome(flat(angle=angle), start, (0.0, 0.3, 0.0), until=0.5)
    on_plane = outcome(plane((0, 0, 0), normal), start, (0.0, 0.3, 0.0), until=0.5)
    np.testing.assert_allclose(on_mesh, on_plane, atol=1e-9)


def wings(angle, length=1.0):
    """Two facets pairs that meet along y at x = 0 and rise (fall) away from it at `angle`."""
    x = np.array([-length, 0.0, length])
    return heightmap(x, np.array([-1.0, 1.0]), np.tile(abs(x) * tan(angle), (2, 1)))


@pytest.mark.parametrize("degrees", [25.0, 45.0])
def test_a_sharp_groove_is_two_planes(degrees):
    """Rest and rebound in a groove: both sides carry, as two planes do."""
    angle = radians(degrees)
    planes = join(
        plane((0, 0, 0), (-sin(angle), 0, cos(angle))),
        plane((0, 0, 0), (sin(angle), 0, cos(angle))),
    )
    start = (0.003, 0.0, R / cos(angle) + 0.05)
    for until in (0.12, 1.2):
        on_mesh = outcome(wings(angle), start, until=until)
        np.testing.assert_allclose(on_mesh, outcome(planes, start, until=until), atol=1e-9)


def test_a_hardly_bent_groove_carries_once():
    """In a groove of 2 degrees a ball rests as on a plane: two contacts would halve the overlap."""
    angle = radians(2.0)
    law = LAW._replace(friction=0.0, rolling_friction=0.0)
    end = outcome(wings(angle), (0.0, 0.0, R), until=1.0, law=law)[0]
    depth = R - end[2] * cos(angle)
    assert depth == pytest.approx(M * G / KN, rel=0.02)


@pytest.mark.parametrize("degrees", [2.0, 20.0, 45.0])
def test_a_ball_balances_on_a_ridge(degrees):
    """The overlap with the edge alone is m g/k_n: the facets beside it add nothing."""
    run = simulate(wings(-radians(degrees)), (0.0, 0.0, R))
    run.run(0.5, 0.5)
    state = run.state()
    assert R - state.position[0, 2] == pytest.approx(M * G / KN, rel=1e-6)
    np.testing.assert_allclose(state.position[0, :2], 0.0, atol=1e-12)


def test_rolling_over_a_ridge_loses_no_energy():
    """Without friction and damping a ball slides over a convex edge with its energy unchanged."""
    law = ContactLaw(friction=0.0, rolling_friction=0.0, damping_normal=0.0, damping_shear=0.0)
    start = (-0.5, 0.0, -0.5 * tan(radians(8.0)) + R / cos(radians(8.0)) - 1e-4)
    run = simulate(wings(-radians(8.0)), start, (2.5, 0.0, 2.5 * tan(radians(8.0))), law=law)
    state = run.state()
    before = (
        0.5 * np.sum(state.velocity**2)
        + G * state.position[0, 2]
        + run.survey_contacts().energy / M
    )
    run.run(0.35, 0.35)
    state = run.state()
    after = (
        0.5 * np.sum(state.velocity**2)
        + G * state.position[0, 2]
        + run.survey_contacts().energy / M
    )
    assert state.position[0, 0] > 0.2
    assert after == pytest.approx(before, rel=2e-4)


def test_energy_over_waves():
    """Bumpy ground, no friction, no damping: energy within 1e-3 over many edges and bounces."""
    x = np.linspace(-2.0, 2.0, 21)
    height = 0.08 * np.sin(3.0 * x)[None, :] * np.cos(2.0 * x)[:, None]
    law = ContactLaw(friction=0.0, rolling_friction=0.0, damping_normal=0.0, damping_shear=0.0)
    run = simulate(heightmap(x, x, height), (-1.0, 0.1, 0.35), (1.5, 0.2, 0.0), law=law, step=2e-5)
    energies = []
    for k in range(8):
        run.run(0.1 * k + 1e-9, 0.1 * k + 1e-9)
        state = run.state()
        kinetic = 0.5 * np.sum(state.velocity**2) + 0.2 * R**2 * np.sum(state.angular_velocity**2)
        energies.append(kinetic + G * state.position[0, 2] + run.survey_contacts().energy / M)
    np.testing.assert_allclose(energies, energies[0], rtol=1e-3)


def test_restitution_on_a_facet_across_sizes_of_facets():
    """The rebound does not depend on how fine a flat mesh is, down to facets of half a radius."""
    start, velocity = (0.013, 0.041, R + 0.01), (0.0, 0.0, -1.0)
    exact = outcome(floor(), start, velocity, until=0.1)
    for size in (0.5, 0.1, 0.05):
        places = np.arange(-0.5, 0.5 + 0.5 * size, size)
        mesh = heightmap(places, places, np.zeros((len(places), len(places))))
        np.testing.assert_allclose(outcome(mesh, start, velocity, until=0.1), exact, atol=1e-9)


def test_a_ball_rolls_off_the_rim_of_a_mesh():
    """The ball goes over the rim and falls; nothing throws it up."""
    run = simulate(flat(), (0.7, 0.0, R - M * G / KN), (3.0, 0.0, 0.0))
    highest = 0.0
    for k in range(30):
        run.run(0.02 * (k + 1), 0.6)
        highest = max(highest, run.state().position[0, 2])
    assert highest < R + 1e-6
    assert run.state().position[0, 2] < -0.1


def test_ground_holds_a_ball_pressed_deeper_than_its_radius():
    """Below heights is rock: a ball with its centre 1.5 radii below comes back up."""
    run = simulate(flat(), (0.1, 0.03, -1.5 * R))
    run.run(0.05, 0.05)
    assert run.state().position[0, 2] > 0.0


def test_a_surface_that_ends_on_the_floor_has_no_rim_there():
    """A ball at rest on the floor beside the foot of a pile does not feel the foot."""
    x = np.array([-1.0, 0.0, 1.0])
    ground = heightmap(x, x, np.tile(np.array([0.0, 0.0, 0.02]), (3, 1)), base=0.0)
    rise = np.cross(
        ground.corner[:, 1] - ground.corner[:, 0], ground.corner[:, 2] - ground.corner[:, 0]
    )
    assert np.sum(rise[:, 2] > 0.0) == 4
    rest = M * G / KN
    end = outcome(join(floor(), ground), (-0.0023, 0.3, R - rest), until=0.3)[0]
    np.testing.assert_allclose(end[:3], (-0.0023, 0.3, R - rest), atol=1e-9)


def test_nothing_comes_below_ground_from_the_side():
    """Thirty balls thrown at the end of ground 0.35 m high, three and a half radii: energy closes.

    The face stops a ball as a plane in its place does, to where rounding makes two paths of one. In
    the pile none is left in the rock.
    """
    x = np.linspace(0.0, 2.0, 5)
    ground = join(floor(), heightmap(x, x, np.full((5, 5), 0.35), base=0.0))
    assert surface_faults(ground.corner) == []
    start, velocity = (-0.3, 0.9, R - M * G / KN), (2.0, 0.0, 0.0)
    stopped = outcome(ground, start, velocity, until=0.15)
    face = join(floor(), plane((0, 0, 0), (-1, 0, 0)))
    np.testing.assert_allclose(stopped, outcome(face, start, velocity, until=0.15), atol=1e-9)
    grid = np.stack(np.meshgrid(*map(np.arange, (2, 5, 3)), indexing="ij"), axis=-1).reshape(-1, 3)
    place = np.array([-0.45, 0.5, R]) + 0.202 * grid
    balls = particles_at_rest(place, np.full(len(place), R))
    balls.velocity[:, 0] = 4.0
    case = CastCase(balls, LAW, ground, np.zeros(0), np.zeros((0, 3)), max_time=1.0, time_step=2e-4)
    result = run_cast(case)
    assert abs(result.ledger.residual) < 0.01
    end = result.particles.position
    over = (end[:, 0] > 0.0) & (end[:, 0] < 2.0) & (end[:, 1] > 0.0) & (end[:, 1] < 2.0)
    assert (end[over, 2] > 0.35).all()
    assert (end[:, 2] > 0.9 * R).all()


def test_box_of_facets_as_obstacle_is_hit_on_all_sides():
    """A closed box: the rebound from each side is that from a plane in its place."""
    box = surface(box_corners(0.3))
    for axis in range(3):
        for side in (-1.0, 1.0):
            start, velocity = np.full(3, 0.05), np.zeros(3)
            start[axis], velocity[axis] = side * (0.3 + R + 0.01), -side
            normal = np.zeros(3)
            normal[axis] = side
            wall = plane(normal * 0.3, normal)
            on_box = outcome(box, start, velocity, until=0.05)
            np.testing.assert_allclose(
                on_box, outcome(wall, start, velocity, until=0.05), atol=1e-9
            )


def box_corners(half: float) -> np.ndarray:
    """Twelve facets of a cube, turned outwards."""
    facets = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (-1.0, 1.0):
            square = np.zeros((4, 3))
            square[:, axis] = side * half
            square[:, u] = np.array([-1, 1, 1, -1]) * half
            square[:, v] = np.array([-1, -1, 1, 1]) * half
            turned = square if side > 0 else square[::-1]
            facets += [turned[[0, 1, 2]], turned[[0, 2, 3]]]
    return np.array(facets)
