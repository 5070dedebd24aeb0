"""Signals: noted where work has a state to keep, heard where compiled code takes long."""

from __future__ import annotations

import os
import signal
import threading
import time

import numpy as np
import pytest

from castblast.stopping import (
    NEVER,
    Stopped,
    deferred_stop,
    interruptible,
    sigterm_as_interrupt,
)

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_is_noted_and_obeyed_later(number: int, code: int) -> None:
    before = [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)]
    with deferred_stop() as request:
        assert not request.made
        os.kill(os.getpid(), number)
        assert request.made
        with pytest.raises(Stopped, match="kept in a file") as caught:
            request.obey("kept in a file")
    assert caught.value.exit_code == code
    assert isinstance(caught.value, KeyboardInterrupt)
    assert [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)] == before
    assert not NEVER.made


def test_the_second_signal_does_not_wait() -> None:
    with deferred_stop():
        os.kill(os.getpid(), signal.SIGINT)
        with pytest.raises(Stopped, match="at once"):
            os.kill(os.getpid(), signal.SIGINT)


def test_a_signal_that_the_caller_ignores_stays_ignored() -> None:
    """As under nohup, or in the background of a shell."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with deferred_stop() as request:
            os.kill(os.getpid(), signal.SIGINT)
            assert not request.made
    finally:
        signal.signal(signal.SIGINT, before)


def test_no_handler_outside_the_main_thread() -> None:
    seen: list[bool] = []

    def work() -> None:
        with deferred_stop() as request:
            seen.append(request.made)
        seen.append(interruptible(lambda: True))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [False, True]


def test_sigterm_ends_the_work_like_ctrl_c() -> None:
    with pytest.raises(Stopped) as caught, sigterm_as_interrupt():
        os.kill(os.getpid(), signal.SIGTERM)
    assert caught.value.exit_code == 143


def test_a_call_that_hears_nothing_is_left_behind() -> None:
    end = threading.Event()
    timer = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        interruptible(end.wait, 60.0)
    assert time.monotonic() - begun < 5.0
    end.set()


def test_a_result_a_fault_and_the_floating_point_settings_come_through() -> None:
    assert interruptible(divmod, 7, 2) == (3, 1)
    with pytest.raises(KeyError, match="gone"):
        interruptible({}.__getitem__, "gone")
    with np.errstate(over="raise"):
        assert interruptible(np.geterr)["over"] == "raise"
    with np.errstate(over="ignore"):
        assert interruptible(np.geterr)["over"] == "ignore"
