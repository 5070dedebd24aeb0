"""A user's own estimator or torch module, named by ``package.module:function``."""

from __future__ import annotations

import importlib
import inspect
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin

from castblast.errors import SpecError, nearest_name
from castblast.network import run_layers
from castblast.surrogate.fitting.families.chains import Chain
from castblast.surrogate.fitting.families.dense_models import layers_of
from castblast.types import FloatArray

#: Given to a factory that has parameters of these names.
_OFFERED = ("inputs", "outputs", "seed")


class CustomModel(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """Makes the user's model when it is fitted, so that it is new for every fit.

    Parameters
    ----------
    factory : str
    options : mapping
    folder : str
        Looked in first for the module.
    training : mapping
        Of a torch module.
    random_state : int
    watch : callable, optional
        Handed to a torch module's training.

    Attributes
    ----------
    model_
        The user's estimator, fitted.
    layers_ : tuple of Layer
        Where the model is a chain of dense layers.
    """

    def __init__(
        self,
        factory: str,
        options: Mapping[str, Any] | None = None,
        folder: str = "",
        training: Mapping[str, float] | None = None,
        random_state: int = 0,
        watch: Any = None,
    ) -> None:
        self.factory = factory
        self.options = options
        self.folder = folder
        self.training = training
        self.random_state = random_state
        self.watch = watch

    def fit(self, x: Any, y: Any) -> Self:
        """Make the model and fit it to scaled rows x (n, k) and scaled targets y.

        Raises
        ------
        SpecError
            There is no such factory, or what it makes cannot be fitted or used.
        """
        targets = np.asarray(y, dtype=np.float64)
        with importable(self.folder):
            self.model_ = self._make(x.shape[1], 1 if targets.ndim == 1 else targets.shape[1])
            try:
                self.model_.fit(x, y)
            except (TypeError, ValueError, AttributeError, RuntimeError) as fault:
                message = f"{self.factory}: its model cannot be fitted: {fault}"
                raise SpecError(message) from fault
        self._check_shape(x, targets)
        for name in ("n_iter_", "converged_"):
            if hasattr(self.model_, name):
                setattr(self, name, getattr(self.model_, name))
        chain: Chain | None = layers_of(self.model_)
        if chain is not None and _is_same(self.model_, chain, x):
            self.layers_ = chain
        return self

    def predict(self, x: Any) -> FloatArray:
        """Evaluate scaled rows (n, k)."""
        with importable(self.folder):
            values: FloatArray = np.asarray(self.model_.predict(x), dtype=np.float64)
        return values

    def _make(self, inputs: int, outputs: int) -> Any:
        function = load_factory(self.factory, self.folder)
        offered = dict(zip(_OFFERED, (inputs, outputs, self.random_state), strict=True))
        arguments = {**_taken(function, offered), **(self.options or {})}
        model = self._call(function, arguments)
        if _may_be_torch(model):
            from castblast.surrogate.fitting.families import torch_mlp

            if torch_mlp.is_module(model):
                # Once more, now that it is known whose random numbers its weights come from.
                with torch_mlp.determined(self.random_state):
                    model = self._call(function, arguments)
                schedule = torch_mlp.Schedule(**_numbers(self.training or {}))
                return torch_mlp.TorchRegressor(model, schedule, self.random_state, self.watch)
        missing = [name for name in ("fit", "predict") if not callable(getattr(model, name, None))]
        if missing:
            message = (
                f"{self.factory}: gives a {type(model).__name__} without {' and '.join(missing)}; "
                "a scikit-learn estimator or a torch.nn.Module is needed"
            )
            raise SpecError(message)
        return model

    def _call(self, function: Callable[..., Any], arguments: Mapping[str, Any]) -> Any:
        try:
            return function(**arguments)
        except Exception as fault:
            message = f"{self.factory}: fails with options {dict(self.options or {})}: {fault}"
            raise SpecError(message) from fault

    def _check_shape(self, x: Any, targets: FloatArray) -> None:
        rows = min(3, len(x))
        shape = np.shape(self.predict(x[:rows]))
        wanted = (rows, *targets.shape[1:])
        allowed = {wanted, (rows,)} if wanted[1:] == (1,) else {wanted}
        if targets.ndim == 1:
            allowed.add((rows, 1))
        if shape not in allowed:
            message = (
                f"{self.factory}: its model predicts an array of shape {shape} for {rows} rows, "
                f"{wanted} is needed"
            )
            raise SpecError(message)


def load_factory(factory: str, folder: str = "") -> Callable[..., Any]:
    """Import what ``package.module:function`` names.

    Parameters
    ----------
    factory : str
    folder : str
        Where a module of this name counts before one of another folder that is loaded already.

    Raises
    ------
    SpecError
        No such module, a module that cannot be imported, no such name in it, or nothing that can
        be called.
    """
    place, _, name = factory.partition(":")
    _forget_namesake(place, folder)
    try:
        found: Any = importlib.import_module(place)
    except ModuleNotFoundError as fault:
        own = fault.name is not None and (place + ".").startswith(fault.name + ".")
        what = "no such module" if own else f"its module needs '{fault.name}', which is missing"
        message = f"factory: {factory}: {what}"
        raise SpecError(message) from None
    except Exception as fault:
        message = f"factory: {factory}: its module cannot be imported: {fault}"
        raise SpecError(message) from fault
    for part in name.split("."):
        if not hasattr(found, part):
            names = [entry for entry in dir(found) if not entry.startswith("_")]
            message = f"factory: {factory}: no '{part}' there{nearest_name(part, names)}"
            raise SpecError(message)
        found = getattr(found, part)
    if not callable(found):
        message = f"factory: {factory}: is a {type(found).__name__}, a function is needed"
        raise SpecError(message)
    function: Callable[..., Any] = found
    return function


def _forget_namesake(place: str, folder: str) -> None:
    """Unload a module of another folder that has the name of one in this folder."""
    top = place.partition(".")[0]
    loaded, home = sys.modules.get(top), Path(folder or ".").resolve()
    own = folder and ((home / f"{top}.py").is_file() or (home / top).is_dir())
    if loaded is None or not own:
        return
    file = getattr(loaded, "__file__", None)
    if file is None or home not in Path(file).resolve().parents:
        for name in [n for n in sys.modules if n == top or n.startswith(f"{top}.")]:
            del sys.modules[name]


@contextmanager
def importable(folder: str) -> Iterator[None]:
    """Modules of a folder can be imported, for as long as this lasts."""
    if not folder:
        yield
        return
    sys.path.insert(0, folder)
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path.remove(folder)


def _taken(function: Callable[..., Any], offered: Mapping[str, Any]) -> dict[str, Any]:
    """What of the offered arguments a function names."""
    try:
        names = inspect.signature(function).parameters
    except (TypeError, ValueError):
        return {}
    return {name: value for name, value in offered.items() if name in names}


def _may_be_torch(model: Any) -> bool:
    """Whether a class of torch is among its ancestors; torch itself is not imported for this."""
    return any(kind.__module__.partition(".")[0] == "torch" for kind in type(model).__mro__)


def _numbers(training: Mapping[str, float]) -> dict[str, Any]:
    whole = ("adam_epochs", "batch_size", "max_iterations")
    return {name: int(v) if name in whole else float(v) for name, v in training.items()}


def _is_same(model: Any, chain: Chain, x: Any) -> bool:
    """Whether layers give what the model gives: attributes alone do not prove it."""
    rows = np.asarray(x[:50], dtype=np.float64)
    if chain[0].weights.shape[0] != rows.shape[1]:
        return False
    mine = np.asarray(model.predict(rows)).reshape(len(rows), -1)
    theirs = run_layers(chain, rows)
    return mine.shape == theirs.shape and bool(np.allclose(mine, theirs, rtol=1e-11, atol=1e-13))
