"""Balls that come from elsewhere: put into a state, and what forbids to simulate it, in words."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.balls.particles import Particles, check_particles, particles_at_rest
from castblast.types import FloatArray

#: Overlap over radius with another ball from which a state is refused.
MOST_OVERLAP = 0.10
#: Largest overlap under weight over pressure per modulus, and solid fraction of what weighs.
_LARGEST_OVERLAP, _SOLID = 25.0, 0.6


def initial_state(
    position: ArrayLike,
    radius: ArrayLike,
    *,
    velocity: ArrayLike | None = None,
    spin: ArrayLike | None = None,
    block: ArrayLike | None = None,
    law: ContactLaw | None = None,
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
    law : ContactLaw, optional
        Overlaps under the weight of the balls above are allowed for it; default: a tenth of the
        radius.
    """
    balls = particles_at_rest(position, radius, block, velocity)
    if spin is not None:
        balls = balls._replace(angular_velocity=np.array(spin, dtype=np.float64, order="C"))
    faults = check_particles(balls, MOST_OVERLAP)
    if faults and law is not None and np.isfinite(balls.position).all():
        faults = check_particles(balls, pressed_share(balls, law))
    return balls, faults


def pressed_share(balls: Particles, law: ContactLaw, gravity: float = 9.81) -> FloatArray:
    """Overlap over radius (n,) that balls at rest may have: a tenth, or what weight can cause.

    The pressure of the rock above a ball over the effective modulus is about the mean overlap of
    its contacts; forces in a packing decay exponentially (Radjai et al. 1996), and the largest of a
    million overlaps is some 25 times that. In packings of this project it is 13 among 4,000. A
    bench of 12.5 m with a modulus of 10 MPa passes a tenth in its lower half.
    """
    top = balls.position[:, 2] + balls.radius
    depth = top.max() - top
    strain = _SOLID * law.density * gravity * depth / law.effective_modulus
    return np.asarray(np.maximum(MOST_OVERLAP, _LARGEST_OVERLAP * strain))
