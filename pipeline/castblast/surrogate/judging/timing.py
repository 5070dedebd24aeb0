"""What a fit costs: seconds to fit, bytes to keep, microseconds to ask.

Kept apart from the league table, as no two measurements are the same.
"""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from castblast.network import evaluate_rows
from castblast.surrogate.fitting.training import Fit

#: A measurement is repeated until it has taken this long [s], and the fastest repeat counts.
_LEAST_SECONDS = 0.05
_FEWEST_REPEATS = 3


def timings(fits: Sequence[Fit], batch: int = 1000) -> dict[str, Any]:
    """Measure fits on rows of their own tables, on one thread.

    Parameters
    ----------
    fits : sequence of Fit
    batch : int
        Rows asked at once, at most those there are.

    Returns
    -------
    dict
        Name of the fit to fit_seconds, stored_bytes (the pickled estimator; None if it does not
        pickle), batch_rows and microseconds per row: asked singly and in a batch, of the estimator
        (row, batch) and of the exported network in NumPy (network_row, network_batch; None if it
        has none).
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):  # once: finding the libraries takes longer than a prediction
        return {fit.spec.name: _timing(fit, batch) for fit in fits}


def _timing(fit: Fit, batch: int) -> dict[str, Any]:
    frame = fit.table.frame.iloc[:batch]
    many, single = len(frame), frame.iloc[:1]
    costs: dict[str, Any] = {
        "fit_seconds": fit.seconds,
        "stored_bytes": _stored_bytes(fit.estimator),
        "batch_rows": many,
        "row": _microseconds(lambda: fit.estimator.predict(single)),
        "batch": _microseconds(lambda: fit.estimator.predict(frame)) / many,
        "network_row": None,
        "network_batch": None,
    }
    if fit.network is not None:
        network = fit.network
        numeric = frame[list(network.input_names)].to_numpy(dtype=np.float64)
        places = {name: i for i, name in enumerate(network.explosives)}
        index = np.array([places[name] for name in frame["explosive"]], dtype=np.int64)
        costs["network_row"] = _microseconds(lambda: evaluate_rows(network, numeric[:1], index[:1]))
        costs["network_batch"] = (
            _microseconds(lambda: evaluate_rows(network, numeric, index)) / many
        )
    return costs


def _microseconds(ask: Callable[[], object]) -> float:
    """Fastest of several calls; the first one warms caches and does not count."""
    ask()
    least, repeats, begin = np.inf, 0, time.perf_counter()
    while repeats < _FEWEST_REPEATS or time.perf_counter() - begin < _LEAST_SECONDS:
        started = time.perf_counter()
        ask()
        least = min(least, time.perf_counter() - started)
        repeats += 1
    return 1e6 * float(least)


def _stored_bytes(estimator: Any) -> int | None:
    try:
        return len(pickle.dumps(estimator))
    except (TypeError, AttributeError, pickle.PicklingError):
        return None  # a user's own estimator may hold what does not pickle
