# SPDX-License-Identifier: GPL-3.0-or-later
"""Unregistering ends renders on other threads, waits for them, and lets no other begin."""

import logging
import threading
import time
from collections.abc import Iterator
from typing import Any

import bpy
import pytest

from addon.blender.render import running
from tests.blender.shapes import cube, look, place


@pytest.fixture(autouse=True)
def _restart() -> Iterator[None]:
    yield
    running.start()


class Engine:
    """Stands for an engine; it can be freed."""


def render_until_closing(begun: threading.Event, log: list[str]) -> None:
    """A render that ends a moment after `closing` returns True, and an engine that Blender frees a moment later."""
    engine = Engine()
    with running.picture(engine):
        begun.set()
        while not running.closing():
            time.sleep(0.001)
        time.sleep(0.05)
        log.append("render has ended")
    time.sleep(0.05)
    del engine
    log.append("engine is freed")


def test_closing_waits_for_the_end_of_a_render_and_of_its_engine() -> None:
    begun, log = threading.Event(), []  # type: ignore[var-annotated]
    thread = threading.Thread(target=render_until_closing, args=(begun, log))
    thread.start()
    assert begun.wait(300)
    running.stop()
    log.append("closed")
    thread.join()
    assert log[0] == "render has ended"
    assert log[1:] in (["engine is freed", "closed"], ["closed", "engine is freed"])
    assert not running._threads
    assert not any(isinstance(one, Engine) for one in running._engines)


def test_closing_from_the_rendering_thread_does_not_wait_for_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "END_SECONDS", 900.0)
    engine = Engine()
    start = time.monotonic()
    with running.picture(engine), running.picture(engine):
        running.stop()
    assert time.monotonic() - start < 450


def test_a_render_that_does_not_end_is_reported(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(running, "END_SECONDS", 0.05)
    monkeypatch.setitem(running._threads, -1, 1)
    with caplog.at_level(logging.WARNING):
        running.stop()
    assert "did not end" in caplog.text


def small(scene: Any, size: tuple[int, int], samples: int) -> None:
    """A cube before a camera."""
    place("Cube", cube())
    look(size, (0, 0, 9))
    scene.render.engine, scene.halfspace.samples = "HALFSPACE", samples


@pytest.mark.parametrize("closing", [False, True])
def test_no_render_begins_while_closing(scene: Any, monkeypatch: pytest.MonkeyPatch, *, closing: bool) -> None:
    small(scene, (8, 8), 1)
    begun: list[Any] = []
    original = running.picture

    def begin(engine: Any) -> Any:
        begun.append(engine)
        return original(engine)

    monkeypatch.setattr(running, "picture", begin)
    if closing:
        running._closing.set()
    bpy.ops.render.render()
    assert len(begun) == (0 if closing else 1)


def test_a_render_stops_when_the_engine_closes(scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    small(scene, (640, 480), 1 << 20)
    timer = threading.Timer(1.0, running._closing.set)
    timer.start()
    bpy.ops.render.render()  # a million samples would take hours
    timer.join()
    assert not running._threads
