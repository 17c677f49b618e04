# SPDX-License-Identifier: GPL-3.0-or-later
"""Sky Textures come as pictures and suns, once for each content, and what goes wrong is said."""

import contextlib
import math
import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

import addon
from addon.blender.measure import workloads
from addon.blender.read import sky
from addon.blender.read.images import Gallery
from addon.blender.read.world import read_world
from addon.blender.render import engine
from addon.blender.session import building
from addon.core.base.notes import Notes
from addon.core.base.steps import completed
from tests.blender import shapes


@pytest.fixture
def world(scene: Any) -> Any:
    """A world whose colour is a sky with the sun 30° high, in the direction of +X, half as strong as it is."""
    background = shapes.world()
    made = scene.world
    tree = made.node_tree
    background.inputs["Strength"].default_value = 0.5
    texture = tree.nodes.new("ShaderNodeTexSky")
    texture.sun_elevation, texture.sun_rotation = math.radians(30), math.radians(90)
    tree.links.new(texture.outputs[0], background.inputs["Color"])
    return made


def test_a_sky_is_a_picture_and_a_sun(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    notes, gallery = Notes(), Gallery()
    found, images, suns = read_world(world, notes, gallery)
    assert notes.lines() == []
    assert found.program[-1]["op"] != "image", "its strength is part of the program"
    (picture,) = completed(gallery.read(images, notes))
    height, width = picture.pixels.shape[:2]
    assert width == 2 * height
    brightness = picture.pixels[..., :3].sum(axis=2)
    row, column = np.unravel_index(int(brightness.argmax()), brightness.shape)
    latitude = math.degrees(((row + 0.5) / height - 0.5) * math.pi)
    assert -1 <= latitude <= 45, "brightest about the sun or above the horizon below it"
    assert abs((column + 0.5) / width - 0.5) < 0.05, "+X is in the middle"
    (sun,) = suns
    assert np.allclose(sun.to_world[:3, 2], (math.cos(math.radians(30)), 0, 0.5), atol=1e-5)
    assert sun.angle == pytest.approx(0.009512, abs=1e-5)
    assert sun.hidden_from == ()
    assert min(sun.power) > 0
    assert sun.power[0] > sun.power[2], "a low sun is yellow"

    # Known by content: nothing is rendered again, whatever else changes.
    monkeypatch.setattr(sky, "_run", lambda *_: pytest.fail("rendered again"))
    tree = world.node_tree
    tree.nodes["Background"].inputs["Strength"].default_value = 1.0
    assert read_world(world, notes, Gallery())[2][0].power == pytest.approx([2 * c for c in sun.power])

    # Behind a node, the sun is part of the program.
    texture = shapes.node(tree, "ShaderNodeTexSky")
    gamma = tree.nodes.new("ShaderNodeGamma")
    tree.links.new(texture.outputs[0], gamma.inputs[0])
    tree.links.new(gamma.outputs[0], tree.nodes["Background"].inputs["Color"])
    found, _, suns = read_world(world, notes, Gallery())
    assert suns == []
    assert "DISTANCE" in [step.get("kind") for step in found.program]


@pytest.mark.parametrize(
    "error", [OSError("no Blender"), subprocess.TimeoutExpired("blender", 1), subprocess.CalledProcessError(1, "x")]
)
def test_a_sky_that_cannot_be_rendered_is_said(world: Any, monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise error

    texture = shapes.node(world.node_tree, "ShaderNodeTexSky")
    texture.sun_elevation = 0.123
    monkeypatch.setattr(sky, "_run", fail)
    notes = Notes()
    found, images, suns = read_world(world, notes, Gallery())
    assert (images, suns) == (set(), [])
    assert found.color == pytest.approx([0.5 * c for c in world.color])
    assert "Sky Texture" in notes.lines()[0]
    assert "World" in notes.lines()[0]


def test_the_viewport_does_not_wait(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[str] = []
    monkeypatch.setattr(sky, "_begin", begun.append)
    texture = shapes.node(world.node_tree, "ShaderNodeTexSky")
    texture.sun_elevation = 0.321
    notes = Notes()
    read_world(world, notes, Gallery(), wait=False)
    assert len(begun) == 1
    assert "being prepared" in notes.lines()[0]


def hold_on(_folder: str) -> list[str]:
    """A program that takes longer than any test."""
    return [sys.executable, "-c", "import time; time.sleep(900)"]


def wait_until(true: Any) -> None:
    end = time.monotonic() + 300
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_disabling_the_extension_ends_the_other_blender(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sky, "_command", hold_on)
    texture = shapes.node(world.node_tree, "ShaderNodeTexSky")
    texture.sun_elevation = 0.456
    with pytest.raises(sky.SkyError, match="being prepared"):
        sky.of_node(texture, wait=False)
    wait_until(lambda: sky._processes)
    (process,), (thread,) = tuple(sky._processes), tuple(sky._running.values())
    (look,) = sky._looks.values()
    assert bpy.app.timers.is_registered(look)
    addon.unregister()
    try:
        assert process.poll() is not None
        assert not thread.is_alive()
        assert not bpy.app.timers.is_registered(look)
        assert not any((sky._kept, sky._running, sky._looks, sky._processes))
    finally:
        addon.register()
    # Enabled again it is tried again, and not said to have failed.
    with pytest.raises(sky.SkyError, match="being prepared"):
        sky.of_node(texture, wait=False)
    sky.stop()


def test_a_render_does_not_wait_for_a_sky_that_is_stopped(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sky, "_command", hold_on)
    texture = shapes.node(world.node_tree, "ShaderNodeTexSky")
    texture.sun_elevation = 0.567
    said: list[str] = []

    def render() -> None:
        try:
            sky.of_node(texture, wait=True)
        except sky.SkyError as error:
            said.append(str(error))

    thread = threading.Thread(target=render)
    thread.start()
    wait_until(lambda: sky._processes)
    sky.stop()
    thread.join(300)
    assert len(said) == 1
    assert said[0].startswith("not rendered")


def test_the_other_blender_has_its_time_and_not_more(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(sky, "TIMEOUT", 0.2)
        with pytest.raises(subprocess.TimeoutExpired):
            sky._run(hold_on(""))
    assert not sky._processes
    with pytest.raises(subprocess.CalledProcessError):
        sky._run([sys.executable, "-c", "raise SystemExit(3)"])


def only(world: Any, scene: Any) -> Any:
    """The texture of the world, in a scene with a cube before a camera."""
    scene.world = world
    shapes.place("Cube", shapes.cube())
    shapes.look((8, 8), (0, 0, 8))
    scene.render.engine, scene.halfspace.samples = "HALFSPACE", 1
    return shapes.node(world.node_tree, "ShaderNodeTexSky")


def test_measuring_waits_for_the_sky(world: Any, scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    only(world, scene).sun_elevation = 0.678
    made = sky.Sky(np.ones((4, 8, 4), np.float32), (1.0, 1.0, 1.0), (0.0, 0.0, 1.0), 0.01)
    monkeypatch.setattr(sky, "_render", lambda *_: made)
    monkeypatch.setattr(sky, "_begin", lambda *_: pytest.fail("a sky is begun next to what is timed"))
    found = workloads.current("cube", (8, 8))
    assert found.notes == ()
    assert [light.kind for light in found.render_scene.lights] == ["sun"]


def test_a_build_needs_no_sky(world: Any, scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    only(world, scene).sun_elevation = 0.789
    monkeypatch.setattr(sky, "_begin", lambda *_: pytest.fail("a sky is begun for triangles alone"))
    assert building.build_now(scene, bpy.context.evaluated_depsgraph_get()).triangles == 12
    assert not sky._running


@pytest.mark.parametrize("stop", [False, KeyboardInterrupt], ids=["Esc", "Ctrl-C"])
def test_a_render_that_waits_for_a_sky_can_be_stopped(
    world: Any, scene: Any, monkeypatch: pytest.MonkeyPatch, stop: Any
) -> None:
    only(world, scene).sun_elevation = 0.89
    monkeypatch.setattr(sky, "_command", hold_on)
    monkeypatch.setattr(sky, "TIMEOUT", 600)
    asked: list[int] = []

    def reading(*_: Any) -> bool:
        asked.append(len(sky._processes))
        if not asked[-1] or not stop:
            return not asked[-1]
        raise stop

    monkeypatch.setattr(engine._Picture, "_reading", reading, raising=False)
    with pytest.raises(RuntimeError, match="interrupted") if stop else contextlib.nullcontext():
        bpy.ops.render.render()
    assert asked[-1] == 1, "it was stopped while the other Blender ran"
    assert not any((sky._running, sky._processes))
    assert not [found for found in sky._kept.values() if isinstance(found, sky.SkyError)], "it is tried again"


def test_python_leaves_no_other_blender_behind(tmp_path: Path) -> None:
    script = tmp_path / "leave.py"
    script.write_text(
        """
import sys, time
import bpy
from addon.blender.read import sky
sky._command = lambda folder: [sys.executable, "-c", "import time; time.sleep(900)"]
sky._begin("{}")
while not sky._processes:
    time.sleep(0.01)
print(next(iter(sky._processes)).pid, flush=True)
"""
    )
    folder = tmp_path / "temporary"
    folder.mkdir()
    environment = {**os.environ, "TMPDIR": str(folder), "TEMP": str(folder), "TMP": str(folder)}
    root = Path(addon.__file__).parents[1]
    environment["PYTHONPATH"] = os.pathsep.join([str(root), *os.environ.get("PYTHONPATH", "").split(os.pathsep)])
    done = subprocess.run(
        [sys.executable, str(script)], env=environment, capture_output=True, text=True, timeout=300, check=True
    )
    assert done.stdout.split()[-1].isdigit()
    assert not list(folder.glob("halfspace-sky-*"))
    if os.name == "posix":
        with pytest.raises(ProcessLookupError):
            os.kill(int(done.stdout.split()[-1]), 0)
