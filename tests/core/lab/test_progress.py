# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress of commands: one refreshed line in a terminal, lines at intervals elsewhere."""

import io
import os
import sys

import pytest

from addon.lab.base import progress
from addon.lab.base.progress import Progress


class Screen(io.StringIO):
    """What a terminal shows: its lines without what was written over."""

    terminal = True

    def isatty(self) -> bool:
        return self.terminal

    def lines(self) -> list[str]:
        shown = []
        for whole in self.getvalue().split("\n"):
            line = ""
            for part in whole.split("\r"):
                line = part + line[len(part) :]
            shown.append(line.rstrip())
        return shown


@pytest.fixture(name="now")
def the_clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


@pytest.fixture(name="screen")
def the_screen(monkeypatch: pytest.MonkeyPatch) -> Screen:
    screen = Screen()
    monkeypatch.setattr(progress.shutil, "get_terminal_size", lambda: os.terminal_size((40, 24)))
    monkeypatch.setenv("TERM", "xterm")
    return screen


def test_a_terminal_has_one_line_with_the_time_left(
    screen: Screen, now: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdout", screen)
    with Progress("bench", quiet=100.0) as shown:
        shown.show("building a long name", 0.0)
        assert screen.lines() == ["[bench] building a long name"]
        now[0] += 30.0
        shown.show("timing", 0.25)
        assert screen.lines() == ["[bench] timing, 0:01:30 left"]
        shown.say("left out: obb")
        shown.show("a text that is longer than the terminal is wide", 0.5)
        assert screen.lines() == ["[bench] left out: obb", "[bench] a text that is l…, 0:00:30 left"]
        shown.show("last", None)
    print("a table")
    assert screen.lines() == ["[bench] left out: obb", "a table", ""]


@pytest.mark.parametrize("kind", ["a file", "a dumb terminal"])
def test_elsewhere_lines_stay_and_are_rare(
    screen: Screen, now: list[float], kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen.terminal = kind != "a file"
    monkeypatch.setenv("TERM", "dumb")
    monkeypatch.setattr(sys, "stdout", screen)
    with Progress("bench", quiet=2.0) as shown:
        for seconds, text in ((1.0, "early"), (1.5, "first"), (1.0, "soon"), (1.0, "second")):
            now[0] += seconds
            shown.show(text, 0.5)
        shown.say("stays")
    assert screen.getvalue() == "[bench] first\n[bench] second\n[bench] stays\n"


@pytest.mark.parametrize(
    ("seconds", "done", "text"),
    [(10.0, None, ""), (0.5, 0.5, ""), (10.0, 0.001, ""), (10.0, 1.0, ""), (3000.0, 0.25, ", 2:30:00 left")],
)
def test_no_time_left_is_stated_where_it_is_a_guess(seconds: float, done: float | None, text: str) -> None:
    assert progress.left(seconds, done) == text
