"""Balls of the discrete-element model: arrays, masses, energies and a check of their state.

The balls are rigid spheres of one density. Fragments with corners are not modelled; what corners
do to a pile enters through the rolling resistance of the contact law.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from castblast.types import FloatArray, IntArray


class Particles(NamedTuple):
    """State of all balls.

    Attributes
    ----------
    position : array (n, 3) [m]
        Centres; x in the direction of throw, y along the bench, z up.
    velocity : array (n, 3) [m s-1]
    angular_velocity : array (n, 3) [rad s-1]
    radius : array (n,) [m]
    block : array (n,), int64
        Block that fires the ball; -1: none, the ball is free from the start.
    """

    position: FloatArray
    velocity: FloatArray
    angular_velocity: FloatArray
    radius: FloatArray
    block: IntArray


def particles_at_rest(
    position: ArrayLike,
    radius: ArrayLike,
    block: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
) -> Particles:
    """Make `Particles` from centres (n, 3) [m] and radii (n,) [m], without spin; copies.

    Parameters
    ----------
    position, radius : array_like
    block : array_like (n,), optional
        Default: -1, no block.
    velocity : array_like (n, 3), optional [m s-1]
        Default: at rest.
    """
    centre = np.array(position, dtype=np.float64, order="C").reshape(-1, 3)
    count = len(centre)
    speed = np.zeros((count, 3)) if velocity is None else np.array(velocity, dtype=np.float64)
    group = np.full(count, -1) if block is None else np.array(block)
    return Particles(
        position=centre,
        velocity=np.ascontiguousarray(speed.reshape(count, 3)),
        angular_velocity=np.zeros((count, 3)),
        radius=np.array(radius, dtype=np.float64, order="C").reshape(count),
        block=group.astype(np.int64).reshape(count),
    )


def ball_mass(radius: FloatArray, density: float) -> FloatArray:
    """Mass [kg] of each ball of shape (n,)."""
    return (4.0 / 3.0) * np.pi * density * radius**3


def ball_inertia(radius: FloatArray, density: float) -> FloatArray:
    """Moment of inertia [kg m2] of each ball about its centre, shape (n,)."""
    return 0.4 * ball_mass(radius, density) * radius**2


def centre_of_mass(particles: Particles) -> FloatArray:
    """Centre of mass (3,) [m]; the balls have one density."""
    weight = particles.radius**3
    return np.asarray(weight @ particles.position / weight.sum())


def check_particles(particles: Particles, overlap_share: float | FloatArray = 0.10) -> list[str]:
    """Return every fault of a state in words; an empty list means that it can be simulated.

    Parameters
    ----------
    particles : Particles
    overlap_share : float or array (n,) [-]
        Largest overlap of two balls over their mean radius; of two limits the larger holds. Balls
        at rest under their own weight overlap by a few per cent; much more would throw them apart.
    """
    faults = []
    radius = particles.radius
    for name, values in (("position", particles.position), ("velocity", particles.velocity)):
        bad = np.flatnonzero(~np.all(np.isfinite(values), axis=1))
        if len(bad):
            faults.append(f"{name} of {len(bad)} balls is not finite, first ball {bad[0]}")
    bad = np.flatnonzero(~(np.isfinite(radius) & (radius > 0.0)))
    if len(bad):
        faults.append(
            f"radius of {len(bad)} balls is not positive, first ball {bad[0]}: {radius[bad[0]]:g} m"
        )
    if faults:
        return faults
    return _overlap_faults(particles, overlap_share)


def _overlap_faults(particles: Particles, overlap_share: float | FloatArray) -> list[str]:
    from scipy.spatial import cKDTree

    radius = particles.radius
    pairs = cKDTree(particles.position).query_pairs(
        2.0 * float(radius.max()) * (1.0 - 1e-12), output_type="ndarray"
    )
    first, second = pairs[:, 0], pairs[:, 1]
    distance = np.linalg.norm(particles.position[first] - particles.position[second], axis=1)
    radii = radius[first] + radius[second]
    share = 2.0 * (radii - distance) / radii
    limits = np.broadcast_to(overlap_share, radius.shape)
    limit = np.maximum(limits[first], limits[second])
    bad = np.flatnonzero(share > limit)
    if not len(bad):
        return []
    worst = bad[np.argmax(share[bad] / limit[bad])]
    return [
        f"{len(bad)} pairs of balls overlap by more than {100.0 * limit[worst]:.0f} % of their "
        f"mean radius; worst: balls {first[worst]} and {second[worst]} by "
        f"{100.0 * share[worst]:.0f} %"
    ]
