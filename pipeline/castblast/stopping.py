"""Ctrl-C and SIGTERM: long work ends where its state can be kept, and says how to go on.

Python hears a signal only between two of its own steps. Work that changes its state in many steps
therefore only takes note of a signal (`deferred_stop`) and looks for it where the state is whole;
a single long call into compiled code is left to a thread, while the main thread listens
(`interruptible`).
"""

from __future__ import annotations

import contextvars
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, NoReturn, ParamSpec, TypeVar

import numpy as np

_P = ParamSpec("_P")
_R = TypeVar("_R")

#: Exit codes of the shell for a process that SIGINT or SIGTERM has ended.
INTERRUPTED, TERMINATED = 128 + signal.SIGINT, 128 + signal.SIGTERM
#: Longest time [s] for which the main thread sleeps before it looks for a signal again.
_NAP = 0.1


class Stopped(KeyboardInterrupt):
    """Work was stopped from outside; its text says what is kept and how to go on.

    Not a `CastblastError`: whoever asked for a stop does not want the next piece of work instead.

    Attributes
    ----------
    exit_code : int
        130 after Ctrl-C, 143 after SIGTERM.
    """

    def __init__(self, message: str = "stopped", exit_code: int = INTERRUPTED) -> None:
        super().__init__(message)
        self.exit_code = exit_code


class StopRequest:
    """Whether the work under way has been asked to stop.

    Attributes
    ----------
    signal : int
        SIGINT or SIGTERM; 0: nobody asked.
    """

    def __init__(self) -> None:
        self.signal = 0

    @property
    def made(self) -> bool:
        """Whether somebody asked."""
        return self.signal != 0

    def obey(self, message: str) -> NoReturn:
        """Leave the work with `message`."""
        raise Stopped(message, 128 + (self.signal or signal.SIGINT))


#: Nobody ever asks.
NEVER = StopRequest()


@contextmanager
def deferred_stop() -> Iterator[StopRequest]:
    """Note the first Ctrl-C or SIGTERM instead of raising it; a second one stops at once.

    The work has to look at the request and to `obey` it. Outside the main thread, which alone
    hears signals, the request is never made.
    """
    request = StopRequest()

    def note(number: int, _: FrameType | None) -> None:
        if request.made:
            raise Stopped("stopped at once", 128 + number)
        request.signal = number

    with _handling(note):
        yield request


@contextmanager
def sigterm_as_interrupt() -> Iterator[None]:
    """Let SIGTERM end the work like Ctrl-C, so that it tidies up behind itself."""

    def leave(number: int, _: FrameType | None) -> None:
        raise Stopped(exit_code=128 + number)

    with _handling(leave, (signal.SIGTERM,)):
        yield


@contextmanager
def _handling(
    handler: Callable[[int, FrameType | None], Any],
    numbers: tuple[signal.Signals, ...] = (signal.SIGINT, signal.SIGTERM),
) -> Iterator[None]:
    """Handle signals by `handler` in the main thread; those that the caller ignores stay so."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in numbers}
    # None: a handler that was not set from Python, and could not be put back.
    ours = [n for n, old in before.items() if old not in (signal.SIG_IGN, None)]
    try:
        for number in ours:
            signal.signal(number, handler)
        yield
    finally:
        for number in ours:
            signal.signal(number, before[number])


def interruptible(function: Callable[_P, _R], *args: _P.args, **kwargs: _P.kwargs) -> _R:
    """Call compiled code that takes long, so that Ctrl-C ends the wait for it at once.

    The call runs in a thread, which is left behind by an interrupt and ends with the process: only
    for work that changes nothing outside itself and lets go of the interpreter lock. Floating-point
    settings of NumPy hold there as here.
    """
    if threading.current_thread() is not threading.main_thread():
        return function(*args, **kwargs)
    results: list[_R] = []
    faults: list[BaseException] = []
    here, settings = contextvars.copy_context(), np.geterr()

    def work() -> None:
        try:
            with np.errstate(**settings):  # NumPy 1 keeps them with the thread, not the context
                results.append(here.run(function, *args, **kwargs))
        except BaseException as fault:
            faults.append(fault)

    thread = threading.Thread(target=work, name="castblast-work", daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(_NAP)
    if faults:
        raise faults[0]
    return results[0]
