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

from math import sin
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from castblast.kernel import kernel

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]

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
#: Tolerance of admissibility over the stress scale of a trial.
TOLERANCE = 1e-10


class YieldModel(NamedTuple):
    """Everything of the return that a run needs only once.

    Attributes
    ----------
    friction : float [-]
        N, slope of the yield planes.
    stiffness : float [Pa]
        Scale that turns a stress tolerance into a strain tolerance.
    normal, flow, correction : array (6, 3)
        Plane normals n, flow directions g, and D g [Pa], on sorted stresses.
    sets : int array (11, 3)
        Active sets in the order of trial, -1: unused.
    size : int array (11,)
        Planes in each set; 0 if the set is singular for this material.
    inverse : array (11, 3, 3) [1/Pa]
        Inverse of n_i . D g_j of each set.
    """

    friction: float
    stiffness: float
    normal: FloatArray
    flow: FloatArray
    correction: FloatArray
    sets: IntArray
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
        Plastic shear multiplier of the most compressive direction.
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
    fallback: bool


def friction_number(angle: float) -> float:
    """N = (1 + sin) / (1 - sin) of a friction or dilation angle [rad]."""
    return (1.0 + sin(angle)) / (1.0 - sin(angle))


def apex_tension(ucs: float, friction_angle: float) -> float:
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
    normal = np.zeros((6, 3))
    flow = np.zeros((6, 3))
    for plane in range(SHEAR_PLANES):
        low = 1 if plane == 2 else 0
        high = 1 if plane == 1 else 2
        normal[plane, low] = -1.0
        normal[plane, high] = friction
        flow[plane, low] = -1.0
        flow[plane, high] = dilation
    for plane in range(SHEAR_PLANES, 6):
        normal[plane, 5 - plane] = 1.0
        flow[plane, 5 - plane] = 1.0
    correction = np.empty((6, 3))
    for plane in range(6):
        volume = flow[plane, 0] + flow[plane, 1] + flow[plane, 2]
        for axis in range(3):
            correction[plane, axis] = (
                bulk_modulus - 2.0 / 3.0 * shear_modulus
            ) * volume + 2.0 * shear_modulus * flow[plane, axis]
    sets = _SETS.copy()
    size = np.zeros(sets.shape[0], dtype=np.int64)
    inverse = np.zeros((sets.shape[0], 3, 3))
    matrix = np.zeros((3, 3))
    for s in range(sets.shape[0]):
        n = 0
        while n < 3 and sets[s, n] >= 0:
            n += 1
        for i in range(n):
            for j in range(n):
                matrix[i, j] = 0.0
                for axis in range(3):
                    matrix[i, j] += normal[sets[s, i], axis] * correction[sets[s, j], axis]
        # Without dilation the three shear flows are dependent: the set {13, 12, 23} drops out.
        if _invert(matrix, n, inverse[s]):
            size[s] = n
    stiffness = bulk_modulus + 4.0 / 3.0 * shear_modulus
    return YieldModel(friction, stiffness, normal, flow, correction, sets, size, inverse)


@kernel
def is_elastic(
    model: YieldModel, radial: float, hoop: float, axial: float, ucs: float, tension: float
) -> bool:
    """Say whether a trial stress is admissible (no tolerance)."""
    least = max(radial, hoop, axial)
    most = min(radial, hoop, axial)
    return model.friction * least - most <= ucs and least <= tension


@kernel
def _rank(radial: float, hoop: float, axial: float) -> tuple[int, int, int]:
    """Axes (0 radial, 1 hoop, 2 axial) from the most to the least compressive stress."""
    if radial <= hoop:
        if hoop <= axial:
            return 0, 1, 2
        return (0, 2, 1) if radial <= axial else (2, 0, 1)
    if radial <= axial:
        return 1, 0, 2
    return (1, 2, 0) if hoop <= axial else (2, 1, 0)


@kernel
def _on_axis(axis: int, i: int, j: int, a: float, b: float, c: float) -> float:
    """Value on `axis` of a sorted triple (a, b, c) that lies on axes (i, j, the other)."""
    return a if axis == i else (b if axis == j else c)


@kernel
def return_to_yield(
    model: YieldModel, radial: float, hoop: float, axial: float, ucs: float, tension: float
) -> ReturnedStress:
    """Return an inadmissible trial stress to the strength surface.

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
    i, j, k = _rank(radial, hoop, axial)
    low = min(radial, hoop, axial)
    high = max(radial, hoop, axial)
    mid = _on_axis(j, 0, 1, radial, hoop, axial)
    excess = (
        model.friction * high - low - ucs,
        model.friction * mid - low - ucs,
        model.friction * high - mid - ucs,
        high - tension,
        mid - tension,
        low - tension,
    )
    tolerance = TOLERANCE * (abs(low) + abs(high) + ucs)
    for s in range(model.size.size):
        n = model.size[s]
        if n == 0:
            continue
        s1, s2, s3 = low, mid, high
        p1 = p2 = p3 = t1 = t2 = t3 = shear = 0.0
        feasible = True
        for row in range(n):
            amount = 0.0
            for column in range(n):
                amount += model.inverse[s, row, column] * excess[model.sets[s, column]]
            if amount < -tolerance / model.stiffness:
                feasible = False
                break
            plane = model.sets[s, row]
            s1 -= amount * model.correction[plane, 0]
            s2 -= amount * model.correction[plane, 1]
            s3 -= amount * model.correction[plane, 2]
            if plane < SHEAR_PLANES:
                shear += amount
                p1 += amount * model.flow[plane, 0]
                p2 += amount * model.flow[plane, 1]
                p3 += amount * model.flow[plane, 2]
            else:
                t1 += amount * model.flow[plane, 0]
                t2 += amount * model.flow[plane, 1]
                t3 += amount * model.flow[plane, 2]
        if feasible and _admissible(model.friction, s1, s2, s3, ucs, tension, tolerance):
            return _unsorted(i, j, s1, s2, s3, p1, p2, p3, t1, t2, t3, shear, False)
    bulk = (model.correction[3, 0] * 2.0 + model.correction[3, 2]) / 3.0
    spread = (radial + hoop + axial - 3.0 * tension) / (9.0 * bulk)
    return _unsorted(
        i, j, tension, tension, tension, 0.0, 0.0, 0.0, spread, spread, spread, 0.0, True
    )


@kernel
def _admissible(
    friction: float, s1: float, s2: float, s3: float, ucs: float, tension: float, tolerance: float
) -> bool:
    """All six planes, on the axes as sorted by the trial stress."""
    limit = ucs + friction * tolerance
    return (
        friction * s3 - s1 <= limit
        and friction * s2 - s1 <= limit
        and friction * s3 - s2 <= limit
        and s3 <= tension + tolerance
        and s2 <= tension + tolerance
        and s1 <= tension + tolerance
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
        fallback,
    )
