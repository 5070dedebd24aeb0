"""Networks in PyTorch: the only module that imports it, but for `torch_onnx`.

Float64 on one thread with fixed seeds, so that the same rows give the same weights. Adam on
mini-batches finds the region, L-BFGS with a strong Wolfe line search on all rows goes to the
bottom of it.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
import torch

from castblast.network import Activation, Layer
from castblast.surrogate.fitting.families.chains import Chain, mean_of, one_for_each
from castblast.surrogate.fitting.families.dense_models import ChainRegressor
from castblast.types import FloatArray

#: Gets a function from scaled inputs to scaled targets.
Watch = Callable[[Callable[[FloatArray], FloatArray]], None]

_MODULES: dict[str, type[torch.nn.Module]] = {
    "tanh": torch.nn.Tanh,
    "relu": torch.nn.ReLU,
    "logistic": torch.nn.Sigmoid,
    "silu": torch.nn.SiLU,
}
#: L-BFGS iterations between two looks of a watch.
_ROUND = 50
_HISTORY = 50
#: A relative fall of the loss below this is rounding: there the slope need not come down to its
#: tolerance, and L-BFGS would turn in place.
_ROUNDING = float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class Schedule:
    """How a module is trained; see `castblast.specs.models.model.TorchSpec`."""

    adam_epochs: int = 30
    batch_size: int = 256
    learning_rate: float = 5e-3
    max_iterations: int = 1500
    tolerance: float = 1e-9
    penalty: float = 0.0


@dataclass(frozen=True)
class Training:
    """Iterations of L-BFGS, and whether it ended by its own rule."""

    iterations: int
    converged: bool


class TorchMlp(ChainRegressor):
    """Fully connected network, or the mean of several, or one for each category.

    Parameters
    ----------
    hidden_layers, activation, penalty, adam_epochs, batch_size, learning_rate, max_iterations,
    tolerance, members
        As in `castblast.specs.models.model.TorchSpec`.
    categories : int
        Above 0: the last so many columns are a one-hot code, and each category has a network.
    random_state : int
    watch : callable, optional
        Called every fifth epoch and every 50 iterations with the network as it is.

    Attributes
    ----------
    layers_ : tuple of Layer
    n_iter_ : int
    converged_ : bool
    """

    def __init__(
        self,
        hidden_layers: Sequence[int] = (32, 32),
        activation: Activation = "silu",
        penalty: float = 0.0,
        adam_epochs: int = 30,
        batch_size: int = 256,
        learning_rate: float = 5e-3,
        max_iterations: int = 1500,
        tolerance: float = 1e-9,
        members: int = 1,
        categories: int = 0,
        random_state: int = 0,
        watch: Watch | None = None,
    ) -> None:
        self.hidden_layers = hidden_layers
        self.activation = activation
        self.penalty = penalty
        self.adam_epochs = adam_epochs
        self.batch_size = batch_size
        self.learning_rate = learning_rate
        self.max_iterations = max_iterations
        self.tolerance = tolerance
        self.members = members
        self.categories = categories
        self.random_state = random_state
        self.watch = watch

    def fit(self, x: Any, y: Any) -> Self:
        """Fit scaled rows x (n, k) to scaled targets y (n, m) or (n,)."""
        inputs, targets = np.asarray(x, dtype=np.float64), self._note_shape(y)
        self.n_iter_, self.converged_ = 0, True
        members = [
            self._fit_member(inputs, targets, self.random_state + 1000 * number)
            for number in range(self.members)
        ]
        self.layers_ = mean_of(members) if len(members) > 1 else members[0]
        return self

    def _fit_member(self, x: FloatArray, y: FloatArray, seed: int) -> Chain:
        if not self.categories:
            return self._fit_rows(x, y, seed, self.watch)
        numbers = x.shape[1] - self.categories
        chains = []
        for k in range(self.categories):
            rows = x[:, numbers + k] > 0.5
            chains.append(self._fit_rows(x[rows][:, :numbers], y[rows], seed, None))
        return one_for_each(chains)

    def _fit_rows(self, x: FloatArray, y: FloatArray, seed: int, watch: Watch | None) -> Chain:
        schedule = Schedule(**{f.name: getattr(self, f.name) for f in fields(Schedule)})
        with determined(seed):
            module = _dense(x.shape[1], self.hidden_layers, self.activation, y.shape[1])
            training = train_module(module, x, y, schedule, seed, watch)
        self.n_iter_ += training.iterations
        self.converged_ &= training.converged
        chain = dense_chain(module)
        assert chain is not None
        return chain


class TorchRegressor(ChainRegressor):
    """A user's own module, trained like `TorchMlp`.

    Parameters
    ----------
    module : torch.nn.Module
        Takes (n, k) and gives (n, m); a copy in float64 is trained.
    schedule : Schedule
    random_state : int
    watch : callable, optional

    Attributes
    ----------
    module_ : torch.nn.Module
    layers_ : tuple of Layer
        Only where the module is a plain chain of dense layers.
    """

    def __init__(
        self, module: Any, schedule: Schedule, random_state: int = 0, watch: Watch | None = None
    ) -> None:
        self.module = module
        self.schedule = schedule
        self.random_state = random_state
        self.watch = watch

    def fit(self, x: Any, y: Any) -> Self:
        """Fit scaled rows x (n, k) to scaled targets y (n, m) or (n,)."""
        inputs, targets = np.asarray(x, dtype=np.float64), self._note_shape(y)
        with determined(self.random_state):
            self.module_ = copy.deepcopy(self.module).double()
            training = train_module(
                self.module_, inputs, targets, self.schedule, self.random_state, self.watch
            )
        self.n_iter_, self.converged_ = training.iterations, training.converged
        chain = dense_chain(self.module_)
        if chain is not None:
            self.layers_ = chain
        return self

    def predict(self, x: Any) -> FloatArray:
        """Evaluate rows (n, k)."""
        if hasattr(self, "layers_"):
            return super().predict(x)
        with determined(self.random_state):
            values = _answers(self.module_, np.asarray(x, dtype=np.float64))
        return values[:, 0] if self.as_vector_ else values


def is_module(candidate: Any) -> bool:
    """Whether something is a torch module."""
    return isinstance(candidate, torch.nn.Module)


def train_module(
    module: torch.nn.Module,
    x: FloatArray,
    y: FloatArray,
    schedule: Schedule,
    seed: int,
    watch: Watch | None = None,
) -> Training:
    """Train a module in place: Adam on mini-batches, then L-BFGS on all rows.

    Parameters
    ----------
    module : torch.nn.Module
        Float64.
    x : (n, k)
    y : (n, m)
    schedule : Schedule
    seed : int
        Of the order of the batches.
    watch : callable, optional
    """
    inputs, targets = torch.from_numpy(x.copy()), torch.from_numpy(y.copy())
    weights = [weight for weight in module.parameters() if weight.requires_grad]

    def loss(rows: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
        value = torch.mean((module(rows) - truth) ** 2)
        if schedule.penalty:
            squares = [torch.sum(weight**2) for weight in weights]
            value = value + schedule.penalty * torch.stack(squares).sum()
        return value

    def look() -> None:
        if watch is not None:
            watch(lambda rows: _answers(module, rows))
            module.train()

    module.train()
    if not weights:
        return Training(0, True)
    _adam(loss, weights, inputs, targets, schedule, seed, look)
    return _lbfgs(loss, weights, inputs, targets, schedule, look)


def _adam(
    loss: Callable[[torch.Tensor, torch.Tensor], torch.Tensor],
    weights: list[torch.nn.Parameter],
    inputs: torch.Tensor,
    targets: torch.Tensor,
    schedule: Schedule,
    seed: int,
    look: Callable[[], None],
) -> None:
    if not schedule.adam_epochs:
        return
    order = torch.Generator().manual_seed(seed)
    optimizer = torch.optim.Adam(weights, lr=schedule.learning_rate)
    decay = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, schedule.adam_epochs)
    for epoch in range(1, schedule.adam_epochs + 1):
        for rows in torch.split(torch.randperm(len(inputs), generator=order), schedule.batch_size):
            optimizer.zero_grad()
            loss(inputs[rows], targets[rows]).backward()  # type: ignore[no-untyped-call]
            optimizer.step()
        decay.step()
        if epoch % 5 == 0:
            look()


def _lbfgs(
    loss: Callable[[torch.Tensor, torch.Tensor], torch.Tensor],
    weights: list[torch.nn.Parameter],
    inputs: torch.Tensor,
    targets: torch.Tensor,
    schedule: Schedule,
    look: Callable[[], None],
) -> Training:
    if not schedule.max_iterations:
        return Training(0, False)
    optimizer = torch.optim.LBFGS(
        weights,
        max_iter=_ROUND,
        max_eval=10 * _ROUND,
        history_size=_HISTORY,
        tolerance_grad=schedule.tolerance,
        tolerance_change=0.0,
        line_search_fn="strong_wolfe",
    )

    values: list[float] = []

    def closure() -> torch.Tensor:
        optimizer.zero_grad()
        value = loss(inputs, targets)
        value.backward()  # type: ignore[no-untyped-call]
        values.append(value.item())
        return value

    group, done = optimizer.param_groups[0], 0
    while done < schedule.max_iterations:
        group["max_iter"] = min(_ROUND, schedule.max_iterations - done)
        values.clear()
        optimizer.step(closure)  # type: ignore[no-untyped-call]
        before, done = done, int(optimizer.state[weights[0]].get("n_iter", 0))
        look()
        slopes = [w.grad.abs().max() for w in weights if w.grad is not None]
        at_floor = values[0] - min(values) <= _ROUNDING * values[0]
        if done == before or at_floor or float(torch.stack(slopes).max()) <= schedule.tolerance:
            return Training(done, True)
        # An iteration that gains less than this ends the round; a round that gains less, the fit.
        # Relative to the loss reached, for the optimizer itself knows an absolute bound only.
        group["tolerance_change"] = _ROUNDING * min(values)
    return Training(done, False)


def _answers(module: torch.nn.Module, x: FloatArray) -> FloatArray:
    module.eval()
    with torch.no_grad():
        values: FloatArray = module(
            torch.from_numpy(np.require(x, requirements=["C", "W"]))
        ).numpy()
    return values


def _dense(
    inputs: int, hidden: Sequence[int], activation: Activation, outputs: int
) -> torch.nn.Sequential:
    """Chain of dense layers in float64, Glorot weights (Glorot & Bengio 2010)."""
    parts: list[torch.nn.Module] = []
    width = inputs
    for nodes in hidden:
        parts += [torch.nn.Linear(width, nodes, dtype=torch.float64), _MODULES[activation]()]
        width = nodes
    parts.append(torch.nn.Linear(width, outputs, dtype=torch.float64))
    module = torch.nn.Sequential(*parts)
    for part in parts:
        if isinstance(part, torch.nn.Linear):
            torch.nn.init.xavier_uniform_(part.weight)
    return module


def dense_chain(module: torch.nn.Module) -> Chain | None:
    """A Sequential of Linear and known activations as layers; None for anything else."""
    if not isinstance(module, torch.nn.Sequential):
        return None
    names = {kind: name for name, kind in _MODULES.items()}
    layers: list[Layer] = []
    for part in _flat(module):
        if type(part) is torch.nn.Linear:
            weights = part.weight.detach().numpy().T.astype(np.float64)
            biases = np.zeros(weights.shape[1]) if part.bias is None else part.bias.detach().numpy()
            layers.append(Layer(np.ascontiguousarray(weights), biases.astype(float), "identity"))
        elif type(part) in names and layers and layers[-1].activation == "identity":
            last = layers[-1]
            activation: Any = names[type(part)]
            layers[-1] = Layer(last.weights, last.biases, activation)
        else:
            return None
    return tuple(layers) or None


def as_module(model: TorchMlp | TorchRegressor) -> torch.nn.Module:
    """A fitted model as a module from scaled columns to scaled targets, float64."""
    if isinstance(model, TorchRegressor):
        module: torch.nn.Module = model.module_.eval()
        return module
    parts: list[torch.nn.Module] = []
    for layer in model.layers_:
        inputs, outputs = layer.weights.shape
        part = torch.nn.Linear(inputs, outputs, dtype=torch.float64)
        with torch.no_grad():
            part.weight.copy_(torch.from_numpy(np.ascontiguousarray(layer.weights.T)))
            part.bias.copy_(torch.from_numpy(np.asarray(layer.biases)))
        parts.append(part)
        if layer.activation != "identity":
            parts.append(_MODULES[layer.activation]())
    return torch.nn.Sequential(*parts).eval()


def _flat(module: torch.nn.Module) -> Iterator[torch.nn.Module]:
    for part in module.children():
        if isinstance(part, torch.nn.Sequential):
            yield from _flat(part)
        else:
            yield part


@contextmanager
def determined(seed: int) -> Iterator[None]:
    """One thread, deterministic algorithms, own random numbers; all put back at the end."""
    threads = torch.get_num_threads()
    strict = torch.are_deterministic_algorithms_enabled()
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    try:
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            yield
    finally:
        torch.use_deterministic_algorithms(strict)
        torch.set_num_threads(threads)
