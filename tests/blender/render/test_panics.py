# SPDX-License-Identifier: GPL-3.0-or-later
"""Exceptions that are no `Exception`, as panics of the native module are: reported, and the last picture stays."""

import logging
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.inspector import levels, second, worst
from addon.blender.measure import checking, comparing, cost_maps
from addon.blender.read import extract
from addon.blender.render import baking, denoising, engine, previews, viewport
from addon.blender.samples import arrays
from addon.blender.session import building, reports, trees
from addon.core.session.preview import Preview
from tests.blender.shapes import cube, look, material, place
from tests.blender.viewing import MOST_REDRAWS

TEXT = "internal error: index out of bounds"


class PanicException(BaseException):
    """Stands for the class of PyO3, which no module has as a name."""


def panic(*_: Any, **__: Any) -> Any:
    raise PanicException("index out of\nbounds")


@pytest.fixture
def stage(scene: Any) -> Any:
    """A cube before a camera."""
    scene.render.engine, scene.halfspace.samples = engine.ENGINE, 1
    place("Cube", cube())
    look((32, 24), (0, -8, 0), np.pi / 2)
    return scene


STAGES = {
    "begin": (engine, "_Picture"),
    "settings": (engine, "render_settings"),
    "memory": (engine.room, "check"),
    "read": (engine.extract, "find"),
    "build": (engine.Session, "start"),
    "keep": (engine.trees, "keep"),
    "open": (engine, "Result"),
    "begin to trace": (engine.Session, "render"),
    "trace": (engine, "watch"),
    "copy": (engine, "copy"),
    "denoise": (denoising, "apply"),
    "fill": (engine.Result, "fill"),
    "describe": (engine.Result, "describe"),
    "report": (reports, "keep"),
}
"""Functions that are replaced by a panic, by the stage of a render."""


@pytest.mark.parametrize("during", STAGES)
def test_a_panic_at_any_stage_of_a_render_keeps_the_last_picture(
    stage: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, during: str
) -> None:
    stage.halfspace.use_denoising = True
    old = tmp_path / "picture.png"
    old.write_bytes(b"old")
    stage.render.filepath = str(old)
    with monkeypatch.context() as patched:
        patched.setattr(*STAGES[during], panic)
        for animation in (False, True):
            stage.frame_end = stage.frame_start = 1
            stage.render.filepath = str(old if not animation else tmp_path / "frame-")
            with pytest.raises(RuntimeError, match=TEXT) as raised:
                bpy.ops.render.render(animation=animation, write_still=not animation)
            assert "Traceback" not in str(raised.value)
    assert old.read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["picture.png"]
    # The next render works.
    stage.render.filepath = str(old)
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    assert old.read_bytes() != b"old"


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_other_exceptions_end_a_render_as_before(stage: Any, monkeypatch: pytest.MonkeyPatch, error: Any) -> None:
    def fail(*_: Any, **__: Any) -> Any:
        raise error("the scene\nis odd")

    monkeypatch.setattr(engine.extract, "find", fail)
    with pytest.raises(RuntimeError, match="interrupted" if error is KeyboardInterrupt else "the scene is odd"):
        bpy.ops.render.render()


@pytest.mark.parametrize("during", ["find", "start"])
def test_a_panic_in_a_preview_is_reported(stage: Any, monkeypatch: pytest.MonkeyPatch, during: str) -> None:
    refused: list[str] = []
    refuse = engine.HalfspaceEngine._refuse
    monkeypatch.setattr(
        engine.HalfspaceEngine, "_refuse", lambda own, text: (refused.append(text), refuse(own, text))[0]
    )
    monkeypatch.setattr(*((previews.extract, "find") if during == "find" else (previews.Session, "start")), panic)
    block = material("Red", Base_Color=(1, 0, 0, 1))
    block.use_fake_user = True
    bpy.ops.wm.previews_ensure()
    assert set(refused) == {TEXT}


@pytest.mark.parametrize("during", ["read", "build", "write"])
def test_a_panic_in_a_bake_is_reported(stage: Any, monkeypatch: pytest.MonkeyPatch, during: str) -> None:
    painted = material("Painted", Base_Color=(1, 0, 0, 1))
    target = painted.node_tree.nodes.new("ShaderNodeTexImage")
    target.image, painted.node_tree.nodes.active = bpy.data.images.new("Baked", 8, 8), target
    item = stage.objects["Cube"]
    item.data.materials.append(painted)
    bpy.context.view_layer.objects.active = item
    item.select_set(True)
    places = {"read": (baking.extract, "find"), "build": (baking.Session, "start"), "write": (baking.Bake, "_write")}
    monkeypatch.setattr(*places[during], panic)
    with pytest.raises(RuntimeError, match=TEXT):
        bpy.ops.object.bake(type="NORMAL")


class View:
    """Stands in for `bpy.types.RenderEngine`, which cannot be made outside a window."""

    text = ""

    def update_stats(self, _left: str, right: str) -> None:
        self.text = right

    def get_preview_pixel_size(self, _scene: Any) -> int:
        return 1

    def tag_redraw(self) -> None:
        """Draw nothing."""


@pytest.mark.parametrize("during", ["read", "look", "advance", "upload"])
def test_a_panic_in_the_viewport_is_shown_and_the_last_picture_stays(
    stage: Any, monkeypatch: pytest.MonkeyPatch, during: str
) -> None:
    shown: list[Any] = []
    view, own = viewport.Viewport(), View()
    monkeypatch.setattr(viewport.Viewport, "_show", lambda self, *_: shown.append(self._drawn))
    context = SimpleNamespace(scene=stage, space_data=None, region=None)
    monkeypatch.setattr(viewport.views, "seen", lambda *_: None)
    picture = SimpleNamespace(part=(0, 0, 1, 1))
    view._drawn = picture
    places = {
        "read": (extract.Reading, "found"),
        "look": (Preview, "look"),
        "advance": (Preview, "_trace"),
        "upload": (viewport.Viewport, "_upload"),
    }
    if during != "look":
        monkeypatch.setattr(Preview, "look", lambda *_: None)
    monkeypatch.setattr(*places[during], panic)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    view.update(own, context, depsgraph)
    for _ in range(MOST_REDRAWS):
        view.draw(own, context, depsgraph)
        if own.text == TEXT:
            break
        time.sleep(0.001)
    view.draw(own, context, depsgraph)
    assert own.text == TEXT
    assert shown
    assert shown[-1] is picture or during == "advance"
    view.stop()


OPERATORS = {
    "build_structure": (building, "Job"),
    "compare": (comparing, "comparing"),
    "choose": (comparing, "choosing"),
    "cost_map": (cost_maps, "draw"),
    "check": (checking.check, "steps"),
    "measure_levels": (levels, "measure"),
    "worst_ray": (worst, "find"),
    "build_second": (second, "find"),
    "import_arrays": (arrays.workload, "load_npz"),
}
"""Functions that are replaced by a panic, by the operator."""


@pytest.mark.parametrize("operator", OPERATORS)
def test_a_panic_in_an_operator_is_one_readable_line(
    stage: Any, monkeypatch: pytest.MonkeyPatch, operator: str, caplog: pytest.LogCaptureFixture
) -> None:
    bpy.ops.halfspace.build_structure()
    stage.halfspace.second = "bvh-sah"
    with monkeypatch.context() as patched, caplog.at_level(logging.ERROR):
        patched.setattr(*OPERATORS[operator], panic)
        with pytest.raises(RuntimeError, match=TEXT) as raised:
            getattr(bpy.ops.halfspace, operator)()
    assert "Traceback" not in str(raised.value)
    assert [record for record in caplog.records if record.exc_info]


def test_a_panic_in_the_timer_of_the_build_is_shown_in_the_panel(stage: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    trees.clear()
    building.need(stage)
    monkeypatch.setattr(building, "_advance", panic)
    assert building._tick() is None
    assert building.problem() == TEXT
    building.stop()


def test_a_panic_on_the_thread_of_a_build_ends_the_operator(stage: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    module = building.native.load()
    fake = SimpleNamespace(**{name: getattr(module, name) for name in dir(module) if not name.startswith("__")})
    fake.build = panic
    monkeypatch.setattr(building.native, "load", lambda: fake)
    with pytest.raises(RuntimeError, match=TEXT):
        bpy.ops.halfspace.build_structure()
