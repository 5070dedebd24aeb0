"""Return of a stress by the one plane that nearly every return needs, without a branch.

Whatever does not apply is computed all the same and not selected, so that a loop over many rocks
becomes vector code. Planes and signs as in `castblast.nearfield.rock.mohr_coulomb`, which finds the
edges and corners that one plane cannot.
"""

from __future__ import annotations

from typing import NamedTuple

from castblast.kernel import fused_kernel

#: Tolerance of admissibility over the stress scale of a trial.
TOLERANCE = 1e-10


class PlaneStrength(NamedTuple):
    """What the return by one plane needs of a rock.

    Attributes
    ----------
    friction, dilation : float [-]
        N of the friction angle (> 1) and of the dilation angle (1 <= N_psi <= N).
    lame, twice_shear : float [Pa]
        Elastic constants lambda and 2 G.
    stiffness : float [Pa]
        lambda + 2 G.
    shear_compliance, tensile_compliance : float [1/Pa]
        Multiplier per excess stress on the plane (1, 3) alone and on a tension plane alone.
    shear_strain : float [-]
        sqrt(2/3 e:e) of the flow of the plane (1, 3) per multiplier.
    """

    friction: float
    dilation: float
    lame: float
    twice_shear: float
    stiffness: float
    shear_compliance: float
    tensile_compliance: float
    shear_strain: float


@fused_kernel
def admissible(
    friction: float, s1: float, s2: float, s3: float, ucs: float, tension: float, tolerance: float
) -> bool:
    """All six planes, on the axes as sorted by the trial stress; without a branch."""
    limit = ucs + friction * tolerance
    shear = (
        (friction * s3 - s1 <= limit)
        & (friction * s2 - s1 <= limit)
        & (friction * s3 - s2 <= limit)
    )
    tensile = (
        (s3 <= tension + tolerance) & (s2 <= tension + tolerance) & (s1 <= tension + tolerance)
    )
    return shear & tensile


class SinglePlane(NamedTuple):
    """Return of a trial stress by one plane, on the axes radial, hoop, axial.

    Attributes
    ----------
    radial, hoop, axial : float [Pa]
        The trial stress itself where it is admissible or where one plane is not enough.
    shear, opening : float [-]
        Multipliers of the shear plane (1, 3) and of the tension plane; at most one is not zero.
    shear_radial, shear_hoop, shear_axial : float [-]
        Plastic strain of shear.
    opening_radial, opening_hoop, opening_axial : float [-]
        Plastic strain of tension.
    shear_excess, tensile_excess : float [Pa]
        How far the trial lies beyond either plane; negative inside.
    solved : bool
        False: an edge or a corner is needed, `mohr_coulomb.edge_return` finds it.
    """

    radial: float
    hoop: float
    axial: float
    shear: float
    opening: float
    shear_radial: float
    shear_hoop: float
    shear_axial: float
    opening_radial: float
    opening_hoop: float
    opening_axial: float
    shear_excess: float
    tensile_excess: float
    solved: bool


@fused_kernel
def single_plane_return(
    strength: PlaneStrength, radial: float, hoop: float, axial: float, ucs: float, tension: float
) -> SinglePlane:
    """Return a trial stress by the one plane that nearly every return needs.

    Without a branch, so that a loop over many rocks becomes vector code: whatever does not apply
    is computed all the same and not selected. Arguments as in `mohr_coulomb.edge_return`.
    """
    friction, dilation = strength.friction, strength.dilation
    lame, twice_shear = strength.lame, strength.twice_shear
    high = max(radial, max(hoop, axial))
    low = min(radial, min(hoop, axial))
    mid = max(min(radial, hoop), min(max(radial, hoop), axial))
    shear_excess, tensile_excess = friction * high - low - ucs, high - tension
    tolerance = TOLERANCE * (abs(low) + abs(high) + ucs)
    a = strength.shear_compliance * max(shear_excess, 0.0)
    volume = lame * (dilation - 1.0) * a
    sheared = admissible(
        friction, low - volume + twice_shear * a, mid - volume,
        high - volume - twice_shear * dilation * a, ucs, tension, tolerance,
    )  # fmt: skip
    b = strength.tensile_compliance * tensile_excess
    opened = (tensile_excess > 0.0) & admissible(
        friction, low - lame * b, mid - lame * b, tension, ucs, tension, tolerance
    )
    a = a if sheared else 0.0
    b = b if opened and not sheared else 0.0
    # Axes of the most and of the least compressive stress; equal ones in the order of `_rank`.
    radial_low = (radial <= hoop) & (radial <= axial)
    hoop_low = (not radial_low) & (hoop <= axial)
    axial_low = (not radial_low) & (not hoop_low)
    axial_high = (not axial_low) & (axial >= hoop) & (axial >= radial)
    hoop_high = (not hoop_low) & (not axial_high) & (hoop >= radial)
    radial_high = (not hoop_high) & (not axial_high)
    dilated = dilation * a
    shear_r = -a if radial_low else (dilated if radial_high else 0.0)
    shear_h = -a if hoop_low else (dilated if hoop_high else 0.0)
    shear_a = -a if axial_low else (dilated if axial_high else 0.0)
    opening_r = b if radial_high else 0.0
    opening_h = b if hoop_high else 0.0
    opening_a = b if axial_high else 0.0
    volume = lame * ((dilation - 1.0) * a + b)
    return SinglePlane(
        radial - volume - twice_shear * (shear_r + opening_r),
        hoop - volume - twice_shear * (shear_h + opening_h),
        axial - volume - twice_shear * (shear_a + opening_a),
        a, b, shear_r, shear_h, shear_a, opening_r, opening_h, opening_a,
        shear_excess, tensile_excess, sheared or opened,
    )  # fmt: skip
