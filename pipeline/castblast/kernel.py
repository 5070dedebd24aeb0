"""The one place where Numba is configured.

`@kernel` compiles without the interpreter lock, so that Dask threads run side by side, and with
the NumPy error model, so that a division by zero gives inf (which drivers turn into a status).
No fast-math: results must be the same from run to run.

Compiled code is cached in a folder named by the hash of every kernel source. Numba's own cache
only watches the file of the outermost function, so an edit in an imported kernel would go
unnoticed; a hash over all sources cannot. Numba unpickles what it finds there, so without a folder
that is surely this user's own nothing is cached, and each process compiles for itself.

Without Numba kernels stay plain Python: the same numbers a thousand times slower, enough for the
states of an explosive. What simulates asks for Numba before it begins (`castblast.extras`).
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

from castblast.caches import cache_folder
from castblast.extras import is_installed
from castblast.identity import source_hash

_P = ParamSpec("_P")
_R = TypeVar("_R")
_PACKAGE = Path(__file__).resolve().parent
_SOURCES = ("explosive", "kernel.py", "nearfield", "burden", "muckpile")


@cache
def _has_numba() -> bool:
    return is_installed("numba")


@cache
def _prepare_cache() -> str | None:
    """Name the cache folder before Numba is imported and return it; None: nothing is kept."""
    folder = cache_folder("kernels", source_hash(_SOURCES)[:16])
    if folder is None:
        os.environ.pop("NUMBA_CACHE_DIR", None)
        return None
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    return str(folder)


def is_compiled(package: str) -> bool:
    """Say whether compiled kernels of a subpackage, such as ``nearfield``, lie in the cache."""
    folder = _prepare_cache()
    if folder is None:
        return False
    # Numba names a folder of its cache by the folder of the source.
    rooms = [package, *(path.name for path in (_PACKAGE / package).iterdir() if path.is_dir())]
    return any(any(Path(folder).glob(f"{room}_*/*.nbi")) for room in rooms)


def kernel(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` for one thread without the interpreter lock; types stay visible."""
    return _compile(function, parallel=False)


def parallel_kernel(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` with `prange`; only for code that Dask never maps (the muckpile)."""
    return _compile(function, parallel=True)


def inline_kernel(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` into its callers, otherwise as `lean_kernel`: for innermost loops."""
    return _compile(function, parallel=False, lean=True, inline=True)


def lean_kernel(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a `function` that makes no array and returns none, without counting references.

    Numba counts the references to every array it takes out of a tuple or hands on; inside the
    contact loop of the muckpile that is half of the time.
    """
    return _compile(function, parallel=False, lean=True)


def fused_kernel(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile as `inline_kernel`, merged into its callers before they are optimised.

    A loop whose body calls a function that was optimised by itself does not become vector code.
    """
    return _compile(function, parallel=False, lean=True, inline=True, fused=True)


@cache
def _wide_vectors() -> str | None:
    """CPU features that let the compiler use 512-bit vectors; None: leave the choice to it.

    LLVM prefers 256 bits on every processor of Intel because of the first that had 512. The lanes
    of the near field, nearly all of whose work is vector arithmetic, take 12 percent less time with
    512; results are the same bits.
    """
    from numba.core.codegen import get_host_cpu_features

    features = get_host_cpu_features()
    return f"{features},-prefer-256-bit" if "+avx512f" in features.split(",") else None


def _compile(
    function: Callable[_P, _R],
    *,
    parallel: bool,
    lean: bool = False,
    inline: bool = False,
    fused: bool = False,
) -> Callable[_P, _R]:
    if not _has_numba():
        return function
    folder = _prepare_cache()
    import numba

    # An earlier import of numba has read its settings already.
    numba.config.CACHE_DIR = folder or ""
    numba.config.CPU_FEATURES = numba.config.CPU_FEATURES or _wide_vectors()
    options: dict[str, Any] = {
        "nogil": True,
        "cache": folder is not None,
        "error_model": "numpy",
        "parallel": parallel,
        "forceinline": inline,
        "inline": "always" if fused else "never",
        "_nrt": not lean,
    }
    return cast("Callable[_P, _R]", numba.njit(**options)(function))
