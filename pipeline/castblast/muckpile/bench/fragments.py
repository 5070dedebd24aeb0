"""Fragment sizes of blasted rock: Kuz-Ram and Swebrec, from rock, explosive and pattern.

Kuz-Ram puts the median size of Kuznetsov (1973) into a Rosin-Rammler curve (Cunningham 1983, 1987,
2005). Its size x50 is used as the median, as in all later work, though Kuznetsov meant the mean
(Ouchterlony 2016). Swebrec (Ouchterlony 2005) ends at a largest block and has more fines; joined to
the same median and slope it is the KCO model. Both give shares by mass passing a mesh, here by
volume of balls of that diameter. Left out: the zone of crushed rock around the holes.

The formulas are empirical: sizes in cm, diameters of holes in mm and so on are inside them.
"""

from __future__ import annotations

from math import log, sqrt
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from scipy.optimize import brentq

from castblast.muckpile.bench.sizes import Sizes, mean_ball_volume, sizes_by_volume
from castblast.types import FloatArray

#: Limits of the rock factor and of the uniformity index in the sources.
ROCK_FACTOR = (0.8, 22.0)
UNIFORMITY = (0.7, 2.2)
_NODES = 513
#: Share passing the largest ball of a curve that has no largest size.
_COARSEST = 0.99

Year: TypeAlias = Literal["1987", "2005"]


class RosinRammler(NamedTuple):
    """P(x) = 1 - exp(-ln 2 (x / median)^uniformity), by mass.

    Attributes
    ----------
    median : float [m]
    uniformity : float [-]
    """

    median: float
    uniformity: float


class Swebrec(NamedTuple):
    """P(x) = 1 / (1 + (ln(largest / x) / ln(largest / median))^undulation), by mass.

    Attributes
    ----------
    median, largest : float [m]
    undulation : float [-]
        The exponent b.
    """

    median: float
    largest: float
    undulation: float


SizeCurve: TypeAlias = RosinRammler | Swebrec


class Pattern(NamedTuple):
    """Rock, charge and drilling of one hole, as Kuz-Ram asks for them.

    Attributes
    ----------
    rock_factor : float [-]
        A, 0.8 to 22; see `rock_factor`.
    burden, spacing, bench_height : float [m]
    hole_diameter : float [m]
    charge_length : float [m]
    charge_mass : float [kg]
        Per hole.
    weight_strength : float [-]
        Of the explosive by mass, over that of ANFO.
    drilling_deviation : float [m]
        Standard deviation of the place of a hole.
    delay : float [s]
        Between neighbouring holes in a row; 0: no correction for timing. 2005 only.
    delay_deviation : float [s]
        Standard deviation of the delay. 2005 only.
    wave_velocity : float [m s-1]
        Of longitudinal waves in the rock. 2005 only, with `delay`.
    """

    rock_factor: float
    burden: float
    spacing: float
    bench_height: float
    hole_diameter: float
    charge_length: float
    charge_mass: float
    weight_strength: float = 1.0
    drilling_deviation: float = 0.0
    delay: float = 0.0
    delay_deviation: float = 0.0
    wave_velocity: float = 5000.0


def rock_factor(
    *,
    description: float,
    density: float,
    young_modulus: float,
    ucs: float,
) -> float:
    """Rock factor A = 0.06 (RMD + RDI + HF) after Cunningham (1987), from Lilly (1986).

    Parameters
    ----------
    description : float
        RMD: 10 friable, 50 massive, or the joint factor of `joint_factor`.
    density : float [kg m-3]
    young_modulus, ucs : float [Pa]
        Hardness is E/3 in GPa below 50 GPa, else UCS/5 in MPa.
    """
    influence = 0.025 * density - 50.0
    stiff = young_modulus >= 50e9
    hardness = ucs * 1e-6 / 5.0 if stiff else young_modulus * 1e-9 / 3.0
    return float(np.clip(0.06 * (description + influence + hardness), *ROCK_FACTOR))


def joint_factor(
    spacing: float,
    pattern_size: float,
    dip: Literal["out_of_face", "along_face", "into_face"],
    condition: Literal["tight", "relaxed", "filled"] = "tight",
) -> float:
    """Joint factor of jointed rock: spacing and condition after Cunningham (2005).

    The values of the dip are those of Lilly (1986) and Cunningham (1987), also in Ouchterlony
    (2005); the print of 2005 has those of `out_of_face` and `into_face` exchanged.

    Parameters
    ----------
    spacing : float [m]
        Of the joints.
    pattern_size : float [m]
        sqrt(burden hole spacing).
    dip : str
        Of the joints, seen from the pit.
    condition : str
    """
    if spacing < 0.1:
        place = 10.0
    elif spacing < 0.3:
        place = 20.0
    else:
        place = 80.0 if spacing < 0.95 * pattern_size else 50.0
    angle = {"out_of_face": 20.0, "along_face": 30.0, "into_face": 40.0}[dip]
    return {"tight": 1.0, "relaxed": 1.5, "filled": 2.0}[condition] * place + angle


def kuz_ram(pattern: Pattern, year: Year = "2005") -> RosinRammler:
    """Median and uniformity of Kuz-Ram; the uniformity is kept within 0.7 to 2.2.

    Median (Cunningham 1983): x50 = A K^-0.8 Q^(1/6) (115/RWS)^(19/30) cm, with K in kg/m3, Q in kg
    per hole, RWS 100 for ANFO; the exponent is that of Kuznetsov's own reduction (print of 2005:
    19/20). The 2005 form multiplies it by a factor of the delay.
    """
    p = pattern
    specific = p.charge_mass / (p.burden * p.spacing * p.bench_height)
    strength = (1.15 / p.weight_strength) ** (19.0 / 30.0)
    centimetres = p.rock_factor * specific**-0.8 * p.charge_mass ** (1.0 / 6.0) * strength
    if year == "2005":
        centimetres *= timing_factor(p)
        uniformity = _uniformity_2005(p)
    else:
        uniformity = _uniformity_1987(p)
    return RosinRammler(0.01 * centimetres, float(np.clip(uniformity, *UNIFORMITY)))


def timing_factor(pattern: Pattern) -> float:
    """Factor on the median by the delay between holes (Cunningham 2005); 1 without a delay.

    The finest rock comes at 15.6 ms per m of burden and km/s of wave velocity.
    """
    if pattern.delay <= 0.0:
        return 1.0
    best = 15.6e-3 * pattern.burden / (pattern.wave_velocity * 1e-3)
    t = pattern.delay / best
    if t < 1.0:
        return 0.66 * t**3 - 0.13 * t**2 - 1.58 * t + 2.1
    return 0.9 + 0.1 * (t - 1.0)


def _drilling(p: Pattern) -> float:
    """Factors that both years share: shape of the pattern, deviation, length of the charge."""
    return sqrt(0.5 * (1.0 + p.spacing / p.burden)) * max(
        1.0 - p.drilling_deviation / p.burden, 0.0
    )


def _uniformity_1987(p: Pattern) -> float:
    # Burden in m over diameter in mm; one charge without a column charge above it.
    slender = 2.2 - 14.0 * p.burden / (1e3 * p.hole_diameter)
    return float(slender * _drilling(p) * 1.1**0.1 * p.charge_length / p.bench_height)


def _uniformity_2005(p: Pattern) -> float:
    slender = sqrt(max(2.0 - 30.0 * p.burden / (1e3 * p.hole_diameter), 0.0))
    scatter = 6.0 * p.delay_deviation / p.delay if p.delay > 0.0 else 0.0
    timing = 0.206 + max(1.0 - 0.25 * scatter, 0.0) ** 0.8
    rock = (p.rock_factor / 6.0) ** 0.3
    charge = (p.charge_length / p.bench_height) ** 0.3
    return float(timing * slender * _drilling(p) * charge * rock)


def swebrec_like(curve: RosinRammler, largest: float) -> Swebrec:
    """Swebrec curve with the median and the slope at it of a Rosin-Rammler curve: the KCO model.

    b = 2 ln 2 ln(largest / median) uniformity (Ouchterlony 2005).

    Raises
    ------
    ValueError
        `largest` [m] is not above the median.
    """
    if not largest > curve.median:
        message = f"largest = {largest:g} m: must be above the median, {curve.median:.3g} m"
        raise ValueError(message)
    reach = log(largest / curve.median)
    return Swebrec(curve.median, largest, 2.0 * log(2.0) * reach * curve.uniformity)


def passing(curve: SizeCurve, diameter: FloatArray) -> FloatArray:
    """Share of the mass (n,) that passes a mesh of `diameter` (n,) [m]."""
    size = np.asarray(diameter, dtype=np.float64)
    if isinstance(curve, RosinRammler):
        return np.asarray(-np.expm1(-log(2.0) * (size / curve.median) ** curve.uniformity))
    above = np.maximum(np.log(curve.largest / size), 0.0) / log(curve.largest / curve.median)
    return np.asarray(1.0 / (1.0 + above**curve.undulation))


def coarsest(curve: SizeCurve) -> float:
    """Largest size [m]: that of the curve, or where 99 % pass if it has none."""
    if isinstance(curve, Swebrec):
        return curve.largest
    return float(curve.median * (-np.log2(1.0 - _COARSEST)) ** (1.0 / curve.uniformity))


class CutSizes(NamedTuple):
    """A size curve made fit for balls.

    Attributes
    ----------
    sizes : Sizes
    smallest, largest : float [m]
        Diameters; what lies outside is left out and the rest scaled up to the whole volume.
    finer, coarser : float [-]
        Share of the mass left out on either side.
    """

    sizes: Sizes
    smallest: float
    largest: float
    finer: float
    coarser: float


def cut_sizes(curve: SizeCurve, smallest: float, largest: float) -> CutSizes:
    """Sizes of balls by volume between two diameters [m].

    Raises
    ------
    ValueError
        No part of the curve lies between them.
    """
    if not 0.0 < smallest < largest:
        message = (
            f"smallest = {smallest:g} m: must be positive and below the largest, {largest:g} m"
        )
        raise ValueError(message)
    diameter = np.geomspace(smallest, largest, _NODES)
    share = passing(curve, diameter)
    if not share[-1] - share[0] > 1e-6:
        message = f"no fragments lie between {smallest:g} and {largest:g} m"
        raise ValueError(message)
    sizes = sizes_by_volume(diameter, share)
    return CutSizes(
        sizes=sizes,
        smallest=smallest,
        largest=largest,
        finer=float(share[0]),
        coarser=float(1.0 - share[-1]),
    )


def smallest_for_count(curve: SizeCurve, largest: float, solid_volume: float, count: int) -> float:
    """Smallest diameter [m] with which balls of the curve up to `largest` [m] number `count`.

    Raises
    ------
    ValueError
        Even balls of nearly the largest size are more than `count`.
    """

    def excess(ratio: float) -> float:
        cut = cut_sizes(curve, largest * ratio, largest)
        return log(solid_volume / mean_ball_volume(cut.sizes) / count)

    low, high = 1e-4, 0.95
    if excess(high) > 0.0:
        most = solid_volume / mean_ball_volume(cut_sizes(curve, high * largest, largest).sizes)
        message = f"{count} balls cannot fill the bench; of the largest size it takes {most:.0f}"
        raise ValueError(message)
    if excess(low) < 0.0:
        return low * largest
    return largest * float(brentq(excess, low, high, rtol=1e-6))
