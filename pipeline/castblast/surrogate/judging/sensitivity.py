"""Which inputs matter: Sobol indices of a surrogate over the joint domain, checked by physics.

The inputs of a recipe are independent in its box of marginals (ratios such as stemming over burden
among them), but benches that cannot exist are cut out of it, which ties the inputs together. The
indices are therefore those of a non-rectangular domain (Kucherenko, Klymenko & Shah 2017): points
are drawn from the box and kept if possible, and a part of a point is drawn anew given the rest of
it until the whole is possible. Where nothing is cut out these are the ordinary Sobol indices. With
tied inputs the total indices say what is left unexplained without an input given all others, and
may be below the first-order ones.

The explosive counts as an input, its kinds equally likely. The estimators and their bootstrap
intervals are those of SALib (Saltelli et al. 2010; Jansen 1999).

References
----------
Kucherenko, S., Klymenko, O. V. & Shah, N. (2017), Sobol' indices for problems defined in
non-rectangular domains, Reliab. Eng. Syst. Saf. 167, 218-231.
Saltelli, A. et al. (2010), Variance based sensitivity analysis of model output, Comput. Phys.
Commun. 181, 259-270.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from castblast.progress import ProgressCallback, silent
from castblast.surrogate.fitting.training import Fit
from castblast.surrogate.judging.domain import Domain, Points
from castblast.surrogate.judging.gate import Surrogate, fit_surrogate
from castblast.surrogate.judging.probe import VELOCITY
from castblast.types import BoolArray, FloatArray

#: Places of the unit box (n, d) to answers (n, m).
Ask: TypeAlias = Callable[[FloatArray], FloatArray]
#: Places of the unit box (n, d) to whether they are in the domain (n,).
Possible: TypeAlias = Callable[[FloatArray], BoolArray]

#: Name of the explosive among the inputs.
EXPLOSIVE = "explosive"
_MOST_TRIES = 1000
_RESAMPLES = 100


class Index(NamedTuple):
    """Sobol indices of one input on one target, with the half width of their 95 % intervals."""

    first: float
    first_half_width: float
    total: float
    total_half_width: float

    def to_document(self) -> dict[str, Any]:
        """Give values and intervals as plain JSON values."""
        return {
            "first": self.first,
            "first_interval": [
                self.first - self.first_half_width,
                self.first + self.first_half_width,
            ],
            "total": self.total,
            "total_interval": [
                self.total - self.total_half_width,
                self.total + self.total_half_width,
            ],
        }


class Sample(NamedTuple):
    """Points for the indices of one input, all (n, d) in the unit box.

    Attributes
    ----------
    base, other : Points drawn from the domain, independent of each other.
    same_input : Points that share the input with `base` and are drawn anew in all else.
    same_rest : Points that share all else with `base` and are drawn anew in the input.
    """

    base: FloatArray
    other: FloatArray
    same_input: FloatArray
    same_rest: FloatArray


def sobol_report(
    fit: Fit | Surrogate,
    domain: Domain,
    *,
    rows: int = 16384,
    checked: Sequence[str] = (),
    checked_rows: int = 1024,
    seed: int = 0,
    progress: ProgressCallback = silent,
) -> dict[str, Any]:
    """First and total Sobol index of every varied input on every target, with 95 % intervals.

    Parameters
    ----------
    fit : Fit or Surrogate
    domain : Domain
    rows : int
        Base sample; 2 evaluations of the surrogate a row, and 2 more per input.
    checked : sequence of str
        Inputs whose indices the simulator gives as well; default: the two that matter most to
        the burden velocity and the one that matters most to each other target.
    checked_rows : int
        Base sample of the check: 2 runs of the simulator (1.3 ms) a row and 2 more per input; 0:
        no check.
    seed : int
    progress : callable

    Returns
    -------
    dict
        Plain JSON values: ``method``, ``rows``, ``targets``; ``inputs``, name -> what is varied
        (a ratio for some); ``indices``, target -> input ->
        first, first_interval, total, total_interval; ``physics``, ``rows`` and target -> input ->
        ``simulator`` and ``surrogate``, indices on the same rows, so that their difference is
        that of the models, not of the sample.
    """
    surrogate = fit if isinstance(fit, Surrogate) else fit_surrogate(fit)
    names, kinds = (*domain.sampled, EXPLOSIVE), len(domain.explosives)
    headline = VELOCITY if VELOCITY in surrogate.targets else surrogate.targets[0]

    def points(shares: FloatArray) -> Points:
        kind = np.minimum(shares[:, -1] * kinds, kinds - 1).astype(np.int64)
        return domain.points(np.ascontiguousarray(shares[:, :-1]), kind)

    def possible(shares: FloatArray) -> BoolArray:
        return domain.possible(shares[:, :-1])

    def ask(shares: FloatArray) -> FloatArray:
        answers = surrogate.answers(domain, points(shares))
        return np.stack([answers[name] for name in surrogate.targets], axis=1)

    def simulate(shares: FloatArray) -> FloatArray:
        return domain.simulate(points(shares), surrogate.targets)

    samples = draw_samples(names, possible, rows, seed, progress=progress)
    indices = _by_target(sobol_indices(samples, ask), surrogate.targets)
    if not checked:
        checked = _what_matters(indices, headline)
    physics: dict[str, Any] = {}
    if checked_rows:
        progress(0.7, "Sobol indices: simulator")
        part = draw_samples(names, possible, checked_rows, seed + 1, only=checked)
        simulator = _by_target(sobol_indices(part, simulate), surrogate.targets)
        model = _by_target(sobol_indices(part, ask), surrogate.targets)
        physics = {
            target: {
                name: {
                    "simulator": simulator[target][name].to_document(),
                    "surrogate": model[target][name].to_document(),
                }
                for name in checked
            }
            for target in surrogate.targets
        }
    progress(1.0, "Sobol indices done")
    return {
        "method": "SALib, Sobol indices over the possible designs of the recipe",
        "rows": rows,
        "inputs": {name: _meaning(domain, name) for name in names},
        "targets": list(surrogate.targets),
        "indices": {
            target: {name: index.to_document() for name, index in entries.items()}
            for target, entries in indices.items()
        },
        "physics": {"rows": checked_rows, "targets": physics},
    }


def _what_matters(indices: Mapping[str, Mapping[str, Index]], headline: str) -> list[str]:
    """Inputs of the largest total indices: two of the headline, one of every other target."""
    found: dict[str, None] = {}
    for target, entries in indices.items():
        ranked = sorted(entries, key=lambda name: -entries[name].total)
        found |= dict.fromkeys(ranked[: 2 if target == headline else 1])
    return list(found)


def _meaning(domain: Domain, name: str) -> str:
    """What the recipe varies under a name: the input, or its ratio to another one."""
    spec = domain.recipe.variables.get(name)
    base = None if spec is None else spec.ratio_of
    return (name if base is None else f"{name} over {base}").replace("_", " ")


def draw_samples(
    names: Sequence[str],
    possible: Possible,
    rows: int,
    seed: int = 0,
    *,
    only: Sequence[str] = (),
    progress: ProgressCallback = silent,
) -> dict[str, Sample]:
    """Draw the points that the indices of each input need.

    Parameters
    ----------
    names : sequence of str
        Of the d inputs, in the order of the unit box.
    possible : callable
        Tells places of the domain.
    rows : int
    only : sequence of str
        Inputs that are wanted; default: all.

    Raises
    ------
    ValueError
        A part of a point finds no possible rest.
    """
    rng = np.random.default_rng(seed)
    everything = np.ones(len(names), dtype=bool)
    start = np.zeros((rows, len(names)))
    base = _redraw(start, everything, possible, rng)
    other = _redraw(start, everything, possible, rng)
    samples = {}
    wanted = [name for name in names if not only or name in only]
    for number, name in enumerate(wanted):
        progress(0.6 * number / len(wanted), f"Sobol indices: points for {name}")
        mine = np.array([entry == name for entry in names])
        same_input = _redraw(base, ~mine, possible, rng)
        samples[name] = Sample(base, other, same_input, _redraw(base, mine, possible, rng))
    return samples


def sobol_indices(samples: Mapping[str, Sample], ask: Ask) -> dict[str, list[Index]]:
    """Indices by input, one for each answer of `ask`."""
    first = next(iter(samples.values()))
    base, other = ask(first.base), ask(first.other)
    found = {}
    for number, (name, sample) in enumerate(samples.items()):
        same_input, same_rest = ask(sample.same_input), ask(sample.same_rest)
        found[name] = [
            _index(base[:, j], other[:, j], same_input[:, j], same_rest[:, j], seed=number)
            for j in range(base.shape[1])
        ]
    return found


def _index(
    base: FloatArray, other: FloatArray, same_input: FloatArray, same_rest: FloatArray, seed: int
) -> Index:
    """Indices by the estimators of SALib, from rows where every answer is finite.

    Its first-order estimator is the mean of f(B) (f(AB) - f(A)), A independent of B and AB sharing
    the input with B; its total one half the mean square of f(A) - f(AB), AB sharing all else.
    """
    columns = np.stack([base, other, same_input, same_rest])
    base, other, same_input, same_rest = columns[:, np.isfinite(columns).all(axis=0)]
    first = _analyze(a=other, ab=same_input, b=base, seed=seed)
    total = _analyze(a=base, ab=same_rest, b=other, seed=seed)
    return Index(first["S1"], first["S1_conf"], total["ST"], total["ST_conf"])


def _analyze(a: FloatArray, ab: FloatArray, b: FloatArray, seed: int) -> dict[str, float]:
    from SALib.analyze import sobol

    result = sobol.analyze(
        {"num_vars": 1, "names": ["x"], "bounds": [[0.0, 1.0]]},
        np.stack([a, ab, b], axis=1).ravel(),
        calc_second_order=False,
        num_resamples=_RESAMPLES,
        conf_level=0.95,
        seed=1 + seed,  # SALib takes a seed of 0 for none
    )
    return {key: float(result[key][0]) for key in ("S1", "S1_conf", "ST", "ST_conf")}


def _redraw(
    places: FloatArray, which: BoolArray, possible: Possible, rng: np.random.Generator
) -> FloatArray:
    """Draw some columns (d,) of places (n, d) anew until each place is possible."""
    drawn = places.copy()
    left = np.arange(len(places))
    for _ in range(_MOST_TRIES):
        trial = places[left].copy()
        trial[:, which] = rng.random((len(left), int(which.sum())))
        good = possible(trial)
        drawn[left[good]] = trial[good]
        left = left[~good]
        if not len(left):
            return drawn
    message = f"{len(left)} points of {len(places)} find no possible neighbour"
    raise ValueError(message)


def _by_target(
    found: Mapping[str, Sequence[Index]], targets: Sequence[str]
) -> dict[str, dict[str, Index]]:
    return {
        target: {name: indices[j] for name, indices in found.items()}
        for j, target in enumerate(targets)
    }
