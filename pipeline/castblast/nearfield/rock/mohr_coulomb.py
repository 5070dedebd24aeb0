r"""Mohr-Coulomb strength with a tension cut-off: multi-plane return in principal axes.

The principal axes of a hole under internal pressure never turn (radial, hoop, axial), so the
return needs no rotation, but the *order* of the three principal stresses changes during a blast:
the axial stress starts between the others and becomes the least compressive one in the crushed
rock. All three shear planes and all three tension planes are therefore kept. With the stresses
sorted as s1 <= s2 <= s3 (tension positive, s1 most compressive) they are

    shear    f_ij = N s_j - s_i - UCS <= 0      (i, j) = (1, 3), (1, 2), (2, 3)
    tension  f_k  = s_k - T <= 0                k = 3, 2, 1

with N = (1 + sin phi) / (1 - sin phi). The flow is non-associated in shear (N replaced by
N_psi) and associated in tension, as in the Mohr-Coulomb model of FLAC (Itasca). For a set of
active planes the multipliers follow from n_i . D g_j lambda_j = f_i(trial), whose matrix depends
on the material only and is inverted once per run. Sets are tried from faces over edges to
corners; the first one with multipliers >= 0 and an admissible stress is the answer (the idea of
Clausen, Damkilde & Andersen 2006). If none fits, the stress goes to the apex of the tension
planes and the event is reported: a run in which that happens is not trusted.

The cut-off must lie at or below the apex UCS / (N - 1) of the cone: above it tension would
dissipate negative energy.

The elastic law D is isotropic, stress and elastic strain are any conjugate pair (here: Kirchhoff
stress and logarithmic strain), strengths are passed with every call because they may vary.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from castblast.kernel import kernel
from castblast.nearfield.rock.single_plane import (
    TOLERANCE,
    PlaneStrength,
    admissible,
)

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
_Number = TypeVar("_Number", float, FloatArray)

# Planes: 0, 1, 2 = shear (1,3), (1,2), (2,3); 3, 4, 5 = tension on s3, s2, s1.
SHEAR_PLANES = 3
_SETS = np.array(
    [
        [0, -1, -1],
        [3, -1, -1],
        [0, 3, -1],
        [0, 1, -1],
        [0, 2, -1],
        [3, 4, -1],
        [0, 1, 3],
        [0, 2, 3],
        [0, 3, 4],
        [0, 1, 2],
        [3, 4, 5],
    ],
    dtype=np.int64,
)
_FIRST_EDGE = 2


class YieldModel(NamedTuple):
    """Everything of the return that a run needs only once.

    Attributes
    ----------
    planes : PlaneStrength
    size : int array (11,)
        Planes in each active set of `_SETS`; 0 if the set is singular for this material.
    inverse : array (11, 3, 3) [1/Pa]
        Inverse of n_i . D g_j of each set.
    """

    planes: PlaneStrength
    size: IntArray
    inverse: FloatArray


class ReturnedStress(NamedTuple):
    """Admissible stress and the plastic strain that led there (radial, hoop, axial).

    Attributes
    ----------
    radial, hoop, axial : float [Pa]
    shear_radial, shear_hoop, shear_axial : float [-]
        Plastic strain from shear planes.
    tensile_radial, tensile_hoop, tensile_axial : float [-]
        Plastic strain from tension planes.
    multiplier : float [-]
        Sum of the shear multipliers.
    opening : float [-]
        Sum of the multipliers of tension.
    fallback : bool
        No set of planes was admissible.
    """

    radial: float
    hoop: float
    axial: float
    shear_radial: float
    shear_hoop: float
    shear_axial: float
    tensile_radial: float
    tensile_hoop: float
    tensile_axial: float
    multiplier: float
    opening: float
    fallback: bool


def friction_number(angle: _Number) -> _Number:
    """N = (1 + sin) / (1 - sin) of friction or dilation angles [rad]."""
    sine = np.sin(angle)
    return (1.0 + sine) / (1.0 - sine)  # type: ignore[no-any-return]


def apex_tension(ucs: _Number, friction_angle: _Number) -> _Number:
    """Isotropic tension at the apex of the cone, c / tan phi = UCS / (N - 1) [Pa]."""
    return ucs / (friction_number(friction_angle) - 1.0)


@kernel
def _invert(matrix: FloatArray, n: int, inverse: FloatArray) -> bool:
    """Gauss-Jordan inverse of the leading n x n block; False if it is singular."""
    work = np.zeros((3, 6))
    scale = 0.0
    for i in range(n):
        for j in range(n):
            work[i, j] = matrix[i, j]
            scale = max(scale, abs(matrix[i, j]))
        work[i, 3 + i] = 1.0
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(work[i, k]) > abs(work[pivot, k]):
                pivot = i
        if abs(work[pivot, k]) <= 1e-12 * scale:
            return False
        for j in range(6):
            held = work[k, j]
            work[k, j] = work[pivot, j]
            work[pivot, j] = held
        factor = work[k, k]
        for j in range(6):
            work[k, j] /= factor
        for i in range(n):
            if i != k:
                factor = work[i, k]
                for j in range(6):
                    work[i, j] -= factor * work[k, j]
    inverse[:, :] = work[:, 3:]
    return True


@kernel
def _flow(plane: int, dilation: float) -> tuple[float, float, float]:
    """Flow direction of a plane on sorted axes; with N in place of N_psi its normal."""
    if plane == 0:
        return -1.0, 0.0, dilation
    if plane == 1:
        return -1.0, dilation, 0.0
    if plane == 2:
        return 0.0, -1.0, dilation
    if plane == 3:
        return 0.0, 0.0, 1.0
    return (0.0, 1.0, 0.0) if plane == 4 else (1.0, 0.0, 0.0)


@kernel
def make_yield_model(
    bulk_modulus: float, shear_modulus: float, friction: float, dilation: float
) -> YieldModel:
    """Prepare the return of one rock.

    Parameters
    ----------
    bulk_modulus, shear_modulus : float [Pa]
    friction, dilation : float [-]
        N of the friction angle (> 1) and of the dilation angle (1 <= N_psi <= N).
    """
    twice_shear = 2.0 * shear_modulus
    lame = bulk_modulus - twice_shear / 3.0
    count = _SETS.shape[0]
    size = np.zeros(count, dtype=np.int64)
    inverse = np.zeros((count, 3, 3))
    matrix = np.zeros((3, 3))
    for s in range(count):
        n = 0
        while n < 3 and _SETS[s, n] >= 0:
            n += 1
        for i in range(n):
            n1, n2, n3 = _flow(_SETS[s, i], friction)
            for j in range(n):
                g1, g2, g3 = _flow(_SETS[s, j], dilation)
                volume = lame * (g1 + g2 + g3)
                matrix[i, j] = (
                    n1 * (volume + twice_shear * g1)
                    + n2 * (volume + twice_shear * g2)
                    + n3 * (volume + twice_shear * g3)
                )
        # Without dilation the three shear flows are dependent: the set {13, 12, 23} drops out.
        if _invert(matrix, n, inverse[s]):
            size[s] = n
    stiffness = lame + twice_shear
    planes = PlaneStrength(
        friction, dilation, lame, twice_shear, stiffness, inverse[0, 0, 0], 1.0 / stiffness,
        np.sqrt(2.0 / 3.0 * (1.0 + dilation * dilation)),
    )  # fmt: skip
    return YieldModel(planes, size, inverse)


@kernel
def _rank(radial: float, hoop: float, axial: float) -> tuple[int, int]:
    """Axes (0 radial, 1 hoop, 2 axial) of the most and of the second most compressive stress."""
    if radial <= hoop:
        if hoop <= axial:
            return 0, 1
        return (0, 2) if radial <= axial else (2, 0)
    if radial <= axial:
        return 1, 0
    return (1, 2) if hoop <= axial else (2, 1)


@kernel
def _on_axis(axis: int, i: int, j: int, a: float, b: float, c: float) -> float:
    """Value on `axis` of a sorted triple (a, b, c) that lies on axes (i, j, the other)."""
    return a if axis == i else (b if axis == j else c)


@kernel
def _excess(
    plane: int, friction: float, s1: float, s2: float, s3: float, ucs: float, tension: float
) -> float:
    """How far a stress lies beyond a plane [Pa]; 0 for no plane (-1)."""
    if plane < 0:
        return 0.0
    if plane < SHEAR_PLANES:
        n1, n2, n3 = _flow(plane, friction)
        return n1 * s1 + n2 * s2 + n3 * s3 - ucs
    return (s3 if plane == 3 else (s2 if plane == 4 else s1)) - tension


@kernel
def _share(first: int, second: int, third: int, plane: int, a: float, b: float, c: float) -> float:
    """Multiplier of `plane` in a set of three planes with multipliers a, b, c."""
    if plane == first:
        return a
    if plane == second:
        return b
    return c if plane == third else 0.0


@kernel
def edge_return(
    model: YieldModel, radial: float, hoop: float, axial: float, ucs: float, tension: float
) -> ReturnedStress:
    """Return a trial stress to an edge or corner: try the sets of two and three active planes.

    For what `castblast.nearfield.rock.single_plane.single_plane_return` does not solve.

    Parameters
    ----------
    model : YieldModel
    radial, hoop, axial : float [Pa]
        Elastic trial stress, tension positive.
    ucs : float [Pa]
        Uniaxial compressive strength in the measure of the stress.
    tension : float [Pa]
        Tensile strength, at most `ucs` / (N - 1).
    """
    size, inverse = model.size, model.inverse
    planes = model.planes
    friction, dilation = planes.friction, planes.dilation
    lame, twice_shear = planes.lame, planes.twice_shear
    i, j = _rank(radial, hoop, axial)
    low, high = min(radial, hoop, axial), max(radial, hoop, axial)
    mid = radial if j == 0 else (hoop if j == 1 else axial)
    tolerance = TOLERANCE * (abs(low) + abs(high) + ucs)
    least = -tolerance / planes.stiffness
    for s in range(_FIRST_EDGE, size.size):
        if size[s] == 0:
            continue
        first, second, third = _SETS[s, 0], _SETS[s, 1], _SETS[s, 2]
        e1 = _excess(first, friction, low, mid, high, ucs, tension)
        e2 = _excess(second, friction, low, mid, high, ucs, tension)
        e3 = _excess(third, friction, low, mid, high, ucs, tension)
        a = inverse[s, 0, 0] * e1 + inverse[s, 0, 1] * e2 + inverse[s, 0, 2] * e3
        b = inverse[s, 1, 0] * e1 + inverse[s, 1, 1] * e2 + inverse[s, 1, 2] * e3
        c = inverse[s, 2, 0] * e1 + inverse[s, 2, 1] * e2 + inverse[s, 2, 2] * e3
        if a < least or b < least or c < least:
            continue
        l13 = _share(first, second, third, 0, a, b, c)
        l12 = _share(first, second, third, 1, a, b, c)
        l23 = _share(first, second, third, 2, a, b, c)
        p1, p2, p3 = -l13 - l12, dilation * l12 - l23, dilation * (l13 + l23)
        t1 = _share(first, second, third, 5, a, b, c)
        t2 = _share(first, second, third, 4, a, b, c)
        t3 = _share(first, second, third, 3, a, b, c)
        volume = lame * (p1 + p2 + p3 + t1 + t2 + t3)
        s1 = low - volume - twice_shear * (p1 + t1)
        s2 = mid - volume - twice_shear * (p2 + t2)
        s3 = high - volume - twice_shear * (p3 + t3)
        if admissible(friction, s1, s2, s3, ucs, tension, tolerance):
            sheared = l13 + l12 + l23
            return _unsorted(i, j, s1, s2, s3, p1, p2, p3, t1, t2, t3, sheared, False)
    spread = (low + mid + high - 3.0 * tension) / (3.0 * (3.0 * lame + twice_shear))
    return _unsorted(
        i, j, tension, tension, tension, 0.0, 0.0, 0.0, spread, spread, spread, 0.0, True
    )


@kernel
def _unsorted(
    i: int, j: int, s1: float, s2: float, s3: float, p1: float, p2: float, p3: float,
    t1: float, t2: float, t3: float, shear: float, fallback: bool,
) -> ReturnedStress:  # fmt: skip
    """Put sorted triples back on the axes."""
    return ReturnedStress(
        _on_axis(0, i, j, s1, s2, s3),
        _on_axis(1, i, j, s1, s2, s3),
        _on_axis(2, i, j, s1, s2, s3),
        _on_axis(0, i, j, p1, p2, p3),
        _on_axis(1, i, j, p1, p2, p3),
        _on_axis(2, i, j, p1, p2, p3),
        _on_axis(0, i, j, t1, t2, t3),
        _on_axis(1, i, j, t1, t2, t3),
        _on_axis(2, i, j, t1, t2, t3),
        shear,
        t1 + t2 + t3,
        fallback,
    )
