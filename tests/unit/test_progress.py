"""How long work will still take, as people are told."""

from __future__ import annotations

import pytest

from castblast.progress import duration_words, with_time_left


def test_time_left_follows_from_the_share_of_this_process() -> None:
    now, lines = [0.0], []
    report = with_time_left(lambda _, line: lines.append(line), lambda: now[0])
    for now[0], share in ((0.0, 0.5), (5.0, 0.55), (20.0, 0.6), (60.0, 0.75), (80.0, 1.0)):
        report(share, "at work")
    assert lines == [
        "at work",
        "at work",  # too early to tell
        "at work, about 80 s left",
        "at work, about 60 s left",
        "at work",
    ]


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(2.0, "10 s"), (44.0, "40 s"), (200.0, "3 min"), (9000.0, "2.5 h"), (864000.0, "10 days")],
)
def test_durations(seconds: float, words: str) -> None:
    assert duration_words(seconds) == words
