"""MLflow on one of our stores: the only module that imports it."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


@contextmanager
def open_store(store: Path) -> Iterator[Any]:
    """MLflow on a SQLite file, without telemetry or chatter; the earlier store is put back."""
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    os.environ.setdefault("MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR", "false")
    import mlflow

    loggers = [logging.getLogger(name) for name in ("mlflow", "alembic")]
    levels = [logger.level for logger in loggers]
    earlier = mlflow.get_tracking_uri()
    try:
        for logger in loggers:
            logger.setLevel(logging.ERROR)
        mlflow.set_tracking_uri(f"sqlite:///{store}")
        yield mlflow
    finally:
        mlflow.set_tracking_uri(earlier)
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
