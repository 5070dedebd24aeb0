"""castblast: from explosive, rock and bench to burden velocity and muckpile.

The nouns and verbs of the trade, each loaded when it is first used, so that ``import castblast``
costs nothing:

- `simulate`, `simulate_many`: the physics, one blast or a table of designs
- `sample`, `generate`, `open_dataset`: designs of a recipe, datasets of simulated blasts
- `fit`, `compare`, `load_model`, `Model`: networks that repeat the physics in microseconds
- `load_bench`, `Bench`, `cast`: from a bench to its muckpile
- `explosives`, `variables`: what there is to choose from

Quantities go in as text with a unit (``"80 MPa"``), as numbers in SI, as NumPy arrays, pandas
DataFrames or xarray Datasets; tables come out as DataFrames, arrays as Datasets with units.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from castblast.version import __version__

if TYPE_CHECKING:
    from castblast.api.bench import Bench, load_bench
    from castblast.api.casting import cast
    from castblast.api.catalogue import explosives, variables
    from castblast.api.datasets import generate, open_dataset
    from castblast.api.fitting import compare, fit
    from castblast.api.many import sample, simulate_many
    from castblast.api.model import Model, load_model
    from castblast.api.simulation import simulate

__all__ = [
    "Bench",
    "Model",
    "__version__",
    "cast",
    "compare",
    "explosives",
    "fit",
    "generate",
    "load_bench",
    "load_model",
    "open_dataset",
    "sample",
    "simulate",
    "simulate_many",
    "variables",
]

_HOMES = {
    "Bench": "bench",
    "Model": "model",
    "cast": "casting",
    "compare": "fitting",
    "fit": "fitting",
    "generate": "datasets",
    "open_dataset": "datasets",
    "explosives": "catalogue",
    "load_bench": "bench",
    "load_model": "model",
    "sample": "many",
    "simulate": "simulation",
    "simulate_many": "many",
    "variables": "catalogue",
}


if not TYPE_CHECKING:  # a type checker is to refuse names that are not there

    def __getattr__(name: str) -> Any:
        if name not in _HOMES:
            message = f"module 'castblast' has no attribute '{name}'"
            raise AttributeError(message)
        try:
            found = getattr(import_module(f"castblast.api.{_HOMES[name]}"), name)
        except ModuleNotFoundError as fault:
            from castblast.extras import explained

            missing = explained(fault, f"castblast.{name}")
            if missing is None:
                raise
            raise missing from None
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
