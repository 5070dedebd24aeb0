"""How far a blast may lie from what is printed: the prediction band of every quantity shown.

Two bands go by two names. The **prediction band** says where the blast itself is expected: it
holds what the parameters of the physics model leave open before a calibration, and what no
parameter of it can mend (discrepancy). The **network band** says how closely a network repeats the
physics model; it is a hundred times narrower and no statement about rock.

Until the model has been calibrated on measured blasts the prediction band is a prior: for each
quantity a standard deviation of its natural logarithm, stated here with its reasons. So the band is
a factor either way, the same for all designs. What a network adds is independent of it and adds in
quadrature.

Words, on every screen and page: *calibrated*: parameters fitted to the user's blasts; *validated*:
compared with measurements that fitted nothing; *checked*: compared with another model or a law.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import exp, nan, sqrt
from typing import Any, NamedTuple

from castblast.design.variables import VARIABLES

#: Share of blasts that the prediction band is meant to hold: from the 5th to the 95th percentile.
COVERAGE = 0.90
#: 95th percentile of the standard normal distribution: ends of a 90 % band.
NORMAL_95 = 1.6448536269514722
#: 97.5th percentile: a network band holds 95 % of rows, so it is this many standard deviations.
NORMAL_975 = 1.959963984540054

#: Where the prediction band comes from, as a word and in full.
BASIS_KIND = "prior"
BASIS = "prior: not calibrated on your blasts"
#: Head of a column of prediction bands.
BAND_TITLE = "prediction band"
#: Head of a table of values with their bands.
BAND_HEADER = ("quantity", "value", BAND_TITLE, "unit")
#: What it means, for people, with its basis.
BAND_WORDS = f"prediction band: 5th to 95th percentile of blasts; {BASIS}"
BAND_SENTENCE = f"P{BAND_WORDS[1:]}."


class Prior(NamedTuple):
    """Standard deviation of the natural logarithm of a quantity, and why."""

    sd: float
    reason: str


#: Draws of what nobody measures before a blast (`pipeline/studies/prior_spread.py`): burden
#: parameters, loading rate on strength, dilation, tensile strength. Where nothing measured anchors
#: the level of a quantity, the distance of the draws from the default answer counts as well.
_VELOCITY = Prior(
    0.35,
    "open burden parameters spread one quarry design by 0.36 (6.9 to 23 m/s); the two parameter "
    "sets offered differ by a factor 1.55 for 102 mm and 3 m",
)
_PRESSURE = Prior(
    0.40,
    "loading rate, dilation and tensile strength, seldom measured, shift the default answer by "
    "0.32 and spread it by 0.22; isentrope of the products (10 % in work) 0.08",
)
_HOLE = Prior(
    0.13,
    "loading rate, dilation and tensile strength shift the default answer by 0.09 and spread it "
    "by 0.06; isentrope 0.08: the published tool differs by 1 to 17 %",
)
_ZONE = Prior(
    0.40,
    "what counts as crushed: laws and the published tool lie about a factor 1.4 from a limit of "
    "1 % of strain (0.33); loading rate, dilation and tensile strength 0.19",
)
_ANY_YIELD = Prior(
    0.50, "as the crushed zone, and 0.33 from loading rate, dilation and tensile strength"
)
_EXPLOSION = Prior(0.10, "isentrope of the products: energy and equation of state to some 10 %")

#: Throw of the centre of mass of a simulated pile over free flight, 2/3 v sqrt(2 H / g), and the
#: standard deviation of its logarithm: 29 slices 8 to 24 m high, thrown at 6 to 18 m/s in two to
#: eight rows on a level floor, 0.9 to 2.5 (`pipeline/studies/throw_factor.py`). Rock slides on
#: after landing, the more the faster it is and the lower the bench.
THROW_FACTOR = 1.62
THROW_SD = 0.25

#: Prior of every quantity that is shown with a prediction band; others are shown without one.
PRIORS: dict[str, Prior] = {
    "burden_velocity": _VELOCITY,
    "equilibrium_pressure": _PRESSURE,
    "expanded_hole_radius": _HOLE,
    "crushed_zone_radius": _ZONE,
    "plastic_zone_radius": _ANY_YIELD,
    "hoop_crushed_radius": _ANY_YIELD,
    "tensile_zone_radius": _ANY_YIELD,
    "intense_shear_radius": _ZONE,
    "explosion_pressure": _EXPLOSION,
}


class Ends(NamedTuple):
    """Ends of a band, in the unit of its quantity; NaN: no band is stated."""

    lower: float
    upper: float


def prior_sd(name: str) -> float | None:
    """Standard deviation of the logarithm of a quantity; None where no prior is stated."""
    return PRIORS[name].sd if name in PRIORS else None


def prediction_factor(name: str, network_band: float = 0.0) -> float:
    """Factor by which the prediction band of a quantity reaches either way, at least 1.

    Parameters
    ----------
    name : str
        Of `castblast.design.variables`.
    network_band : float
        Relative half-width of the 95 % band of the network that gave the value; 0 for physics.

    Returns
    -------
    float
        NaN where no prior is stated.
    """
    prior = PRIORS.get(name)
    return nan if prior is None else _factor(prior.sd, network_band / NORMAL_975)


def prediction_band(name: str, value: float, network_band: float = 0.0) -> Ends:
    """Ends of the prediction band about a value; parameters as `prediction_factor`.

    A value below zero, which only a poor network gives, has its ends in order too.
    """
    factor = prediction_factor(name, network_band)
    return Ends(min(value / factor, value * factor), max(value / factor, value * factor))


def throw_band_factor(network_band: float = 0.0) -> float:
    """Factor by which the prediction band of the throw reaches either way.

    Parameters
    ----------
    network_band : float
        Of the burden velocity, see `prediction_factor`.
    """
    velocity = PRIORS["burden_velocity"].sd
    return _factor(velocity, network_band / NORMAL_975, THROW_SD)


def _factor(*sd: float) -> float:
    """Factor of a 90 % band from independent standard deviations of a logarithm."""
    return exp(NORMAL_95 * sqrt(sum(one * one for one in sd)))


def band_document(values: Mapping[str, float], bands: Mapping[str, float] = {}) -> dict[str, Any]:
    """Prediction bands of all values that have one, for a JSON document.

    Parameters
    ----------
    values : mapping of name to float [SI]
    bands : mapping of name to float, optional
        Relative half-widths of the network that gave the values.

    Returns
    -------
    dict
        ``prediction_band``: lower and upper [SI] by name; ``prediction_basis``: kind and words,
        share that the band is meant to hold, and standard deviations of the logarithm.
    """
    known = [name for name in values if name in PRIORS]
    ends = {name: prediction_band(name, values[name], bands.get(name, 0.0)) for name in known}
    return {
        "prediction_band": {name: band._asdict() for name, band in ends.items()},
        "prediction_basis": {
            "kind": BASIS_KIND,
            "words": BASIS,
            "coverage": COVERAGE,
            "sd_of_ln": {name: PRIORS[name].sd for name in known},
        },
    }


def show_value(name: str, value: float) -> str:
    """Number of a quantity in its usual unit, with three figures where it has a prediction band.

    More would show the arithmetic, not the blast; six where no band is stated.
    """
    shown = value * VARIABLES[name].display_factor
    return _rounded(shown, 3) if name in PRIORS else f"{shown:.6g}"


def show_band(name: str, value: float, network_band: float = 0.0) -> str:
    """Prediction band for people, in the usual unit: ``"5.5 to 17"``; a dash where none is stated.

    Parameters
    ----------
    name : str
    value : float [SI]
    network_band : float
        See `prediction_factor`.
    """
    if name not in PRIORS:
        return "-"
    figures = 2 if PRIORS[name].sd > 0.2 else 3
    ends = prediction_band(name, value, network_band)
    low, high = (_rounded(end * VARIABLES[name].display_factor, figures) for end in ends)
    return f"{low} to {high}"


def _rounded(value: float, figures: int) -> str:
    """So many figures, never an exponent for everyday sizes."""
    return f"{float(f'{value:.{figures}g}'):.6g}"
