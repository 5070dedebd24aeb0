"""Balls that come from elsewhere: put into a state, and what forbids to simulate it, in words."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from castblast.muckpile.particles import (
    FloatArray,
    Particles,
    check_particles,
    particles_at_rest,
)
from castblast.muckpile.walls import Walls, ground_height

#: Overlap over radius with another ball from which a state is refused.
MOST_OVERLAP = 0.10
#: The same with a wall: under the weight of a high bench small balls sink into the floor by 0.15.
MOST_CUT = 0.25


def initial_state(
    position: ArrayLike,
    radius: ArrayLike,
    *,
    velocity: ArrayLike | None = None,
    spin: ArrayLike | None = None,
    block: ArrayLike | None = None,
) -> tuple[Particles, list[str]]:
    """Make a state from centres (n, 3) [m] and radii (n,) [m], and name its faults; []: none.

    Parameters
    ----------
    position, radius : array_like
    velocity : array_like (n, 3), optional [m s-1]
        Default: at rest.
    spin : array_like (n, 3), optional [rad s-1]
    block : array_like (n,), optional
        Default: -1, no block.
    """
    balls = particles_at_rest(position, radius, block, velocity)
    if spin is not None:
        balls = balls._replace(angular_velocity=np.array(spin, dtype=np.float64, order="C"))
    return balls, check_particles(balls, MOST_OVERLAP)


def wall_faults(balls: Particles, walls: Walls) -> list[str]:
    """Name what cuts a state: walls that reach into balls by more than a quarter of their radius.

    Rectangles and planes are held against every ball; whatever else faces up against the ball's
    lowest point.
    """
    faults = []
    for k in range(len(walls.origin)):
        depth = _depth_in_wall(balls, walls, k)
        bad = np.flatnonzero(depth > MOST_CUT * balls.radius)
        if len(bad):
            worst = bad[np.argmax(depth[bad])]
            faults.append(_cut_line(balls, worst, len(bad), depth[worst], f"wall {k}"))
    ground = ground_height(walls, balls.position[:, 0], balls.position[:, 1])
    depth = ground - (balls.position[:, 2] - balls.radius)
    # Beside a steep wall the ground next to a ball may lie higher than its lowest point.
    bad = np.flatnonzero(balls.position[:, 2] + balls.radius < ground)
    if len(bad) and not faults:
        worst = bad[np.argmax(depth[bad])]
        faults.append(_cut_line(balls, worst, len(bad), depth[worst], "the ground"))
    return faults


def _cut_line(balls: Particles, ball: int, count: int, depth: float, what: str) -> str:
    x, y, z = balls.position[ball]
    return (
        f"{what} cuts {count} ball{'s' if count > 1 else ''} of the packing; worst: ball {ball} at "
        f"({x:.2f}, {y:.2f}, {z:.2f}) m, {depth:.2g} m deep with a radius of "
        f"{balls.radius[ball]:.2g} m"
    )


def _depth_in_wall(balls: Particles, walls: Walls, k: int) -> FloatArray:
    """How deep (n,) [m] each ball stands in the face of wall `k`; 0 or less: not at all.

    Balls wholly behind a bounded wall are on its other side, not in it.
    """
    relative = balls.position - walls.origin[k]
    along, across = relative @ walls.axis1[k], relative @ walls.axis2[k]
    height = relative @ walls.normal[k]
    low1, high1, low2, high2 = walls.bounds[k]
    over = (along >= low1) & (along <= high1) & (across >= low2) & (across <= high2)
    if not np.all(np.isinf(walls.bounds[k])):
        over &= height > -balls.radius
    return np.where(over, balls.radius - height, 0.0)
