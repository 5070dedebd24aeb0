"""The joint domain of a dataset and the physics on it: where a surrogate may be asked what.

A recipe spreads its rows over a box of independent marginals (values, or ratios such as stemming
over burden), from which benches that cannot exist are cut out. `Domain` draws points of that
remainder, tells what lies in it, and runs the simulator there, so that the answers of a surrogate
can be held against the physics at places that are in no dataset.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from castblast.dataset.file.provenance import stored_explosives
from castblast.dataset.rows.design import quantiles
from castblast.dataset.rows.simulation import Simulator, blast_simulator
from castblast.errors import DatasetError
from castblast.specs.recipe import Recipe, recipe_from_text
from castblast.types import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

#: Relative slack of the constraints, as in the design of a dataset.
_ROUND_OFF = 1e-12
_BATCH = 4096
_MOST_BATCHES = 200


class Points(NamedTuple):
    """Points of a domain.

    Attributes
    ----------
    inputs : dict of (n,) [SI]
        Every input of the physics by name, resolved.
    explosive : (n,) int64
        Index into `Domain.explosives`.
    shares : (n, d)
        Place in the unit box: quantile of each sampled variable of the recipe, in its order.
    """

    inputs: dict[str, FloatArray]
    explosive: IntArray
    shares: FloatArray

    @property
    def size(self) -> int:
        """Number of points."""
        return len(self.explosive)

    def take(self, rows: NDArray[np.integer] | BoolArray) -> Points:
        """Give some of the points."""
        inputs = {name: values[rows] for name, values in self.inputs.items()}
        return Points(inputs, self.explosive[rows], self.shares[rows])


@dataclass(frozen=True, eq=False)
class Domain:
    """Joint domain of a recipe, with the simulator on it.

    Attributes
    ----------
    recipe : Recipe
    simulator : Simulator
    explosives : tuple of str
        Names as in the dataset, in the order of the recipe.
    energy : (len(explosives),) [J m-3]
        Heat of explosion of each per volume.
    """

    recipe: Recipe
    simulator: Simulator
    explosives: tuple[str, ...]
    energy: FloatArray

    @property
    def sampled(self) -> tuple[str, ...]:
        """Names of the variables that the recipe varies."""
        return tuple(spec.name for spec in self.recipe.sampled)

    def points(self, shares: FloatArray, explosive: NDArray[np.integer]) -> Points:
        """Map possible places of the unit box (n, d), see `possible`, to inputs.

        Raises
        ------
        SpecError
            A place is impossible.
        """
        return self._resolved(self._raw(shares), explosive, shares)

    def possible(self, shares: FloatArray) -> BoolArray:
        """Tell which places of the unit box (n, d) belong to the domain."""
        return self._allowed(self._raw(shares))

    def spread(self, count: int, seed: int = 0) -> Points:
        """Spread points evenly over the domain: scrambled Sobol points less the impossible ones.

        Raises
        ------
        DatasetError
            Hardly any place of the box is possible.
        """
        from scipy.stats import qmc

        sampler = qmc.Sobol(len(self.recipe.sampled) + 1, rng=np.random.default_rng(seed))
        kept: list[FloatArray] = []
        found = 0
        for _ in range(_MOST_BATCHES):
            shares = sampler.random(_BATCH)
            kept.append(shares[self.possible(shares[:, :-1])])
            found += len(kept[-1])
            if found >= count:
                break
        else:
            message = f"{self.recipe.name}: hardly any design in these ranges is possible"
            raise DatasetError(message)
        chosen = np.concatenate(kept)[:count]
        kinds = np.minimum(chosen[:, -1] * len(self.explosives), len(self.explosives) - 1)
        return self.points(np.ascontiguousarray(chosen[:, :-1]), kinds.astype(np.int64))

    def frame(self, points: Points, features: Sequence[str]) -> pd.DataFrame:
        """Table that an estimator takes: the named features [SI] and ``explosive``."""
        import pandas as pd

        columns = {name: points.inputs[name] for name in features}
        names = np.array(self.explosives, dtype=object)[points.explosive]
        return pd.DataFrame(columns).assign(explosive=names)

    def simulate(self, points: Points, outputs: Sequence[str]) -> FloatArray:
        """Run the physics: (n, m) [SI], NaN in rows that failed."""
        result = self.simulator.run(points.inputs, points.explosive).outputs
        return np.stack([result[name] for name in outputs], axis=1)

    def moved(self, points: Points, changes: Mapping[str, FloatArray]) -> tuple[Points, BoolArray]:
        """Change some inputs and keep every other variable of the recipe at its value.

        A variable that the recipe holds at a ratio follows its base; what is derived follows too.

        Parameters
        ----------
        changes : mapping of input name to (n,) [SI]
            Of variables of the recipe.

        Returns
        -------
        moved : Points
            Rows that would leave the domain are as they were.
        inside : (n,) bool
            Rows that stay in the domain.
        """
        held = {name: points.inputs[name] for name in self.recipe.variables}
        raw = held | dict(changes)
        for spec in self.recipe.fixed:
            if spec.ratio_of is not None:
                raw[spec.name] = spec.at(0.0) * raw[spec.ratio_of]
        inside = self._in_ranges(raw)
        # Twice: outside the ranges a value may be none that the physics even looks at.
        raw = {name: np.where(inside, values, held[name]) for name, values in raw.items()}
        inside &= self._allowed(raw)
        raw = {name: np.where(inside, values, held[name]) for name, values in raw.items()}
        return self._resolved(raw, points.explosive, points.shares), inside

    def _raw(self, shares: FloatArray) -> dict[str, FloatArray]:
        """Variables of the recipe at places of the unit box."""
        recipe = self.recipe
        raw = {spec.name: quantiles(spec, shares[:, j]) for j, spec in enumerate(recipe.sampled)}
        raw |= {spec.name: np.full(len(shares), spec.at(0.0)) for spec in recipe.fixed}
        for spec in (*recipe.sampled, *recipe.fixed):
            if spec.ratio_of is not None:
                raw[spec.name] = raw[spec.name] * raw[spec.ratio_of]
        return raw

    def _resolved(
        self, raw: Mapping[str, FloatArray], explosive: NDArray[np.integer], shares: FloatArray
    ) -> Points:
        inputs = self.simulator.resolve(raw, explosive)
        return Points(dict(inputs), np.asarray(explosive, dtype=np.int64), shares)

    def _in_ranges(self, raw: Mapping[str, FloatArray]) -> BoolArray:
        """Rows whose sampled variables lie between the bounds of the recipe."""
        inside = np.ones(len(next(iter(raw.values()))), dtype=bool)
        for spec in self.recipe.sampled:
            values = raw[spec.name]
            if spec.ratio_of is not None:
                values = values / raw[spec.ratio_of]
            slack = _ROUND_OFF * (spec.at(1.0) - spec.at(0.0))
            inside &= (values >= spec.at(0.0) - slack) & (values <= spec.at(1.0) + slack)
        return inside

    def _allowed(self, raw: Mapping[str, FloatArray]) -> BoolArray:
        """Rows that a bench can hold and no constraint of the recipe refuses."""
        allowed: BoolArray = np.array(self.simulator.possible(raw))
        rows = np.flatnonzero(allowed)
        some = {name: values[rows] for name, values in raw.items()}
        inputs = self.simulator.resolve(some, np.zeros(len(rows), dtype=np.int64))
        rules, ratio = self.recipe.constraints, inputs["stemming_length"] / inputs["burden"]
        kept = inputs["charge_length"] >= rules.minimum_charge_length * (1.0 - _ROUND_OFF)
        kept &= ratio >= rules.minimum_stemming_ratio * (1.0 - _ROUND_OFF)
        if rules.maximum_stemming_ratio is not None:
            kept &= ratio <= rules.maximum_stemming_ratio * (1.0 + _ROUND_OFF)
        allowed[rows] = kept
        return allowed


def dataset_domain(dataset: xr.Dataset, where: str = "dataset") -> Domain:
    """Domain of a dataset, from the recipe and the explosives it carries.

    Raises
    ------
    DatasetError
        It carries none, as a table that was not made by a recipe.
    SpecError
        They are none of this version.
    """
    missing = [key for key in ("recipe", "explosive_specs") if key not in dataset.attrs]
    if missing:
        message = f"{where}: carries no {' and no '.join(missing)}, so its domain is not known"
        raise DatasetError(message)
    recipe = recipe_from_text(str(dataset.attrs["recipe"]), f"{where}: recipe")
    stored = stored_explosives(dataset.attrs, where)
    explosives = tuple(entry.spec.to_explosive() for entry in stored.values())
    energy = np.array([entry.density * entry.heat_of_explosion for entry in explosives])
    return Domain(recipe, blast_simulator(recipe, explosives), tuple(stored), energy)
