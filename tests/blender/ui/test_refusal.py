# SPDX-License-Identifier: GPL-3.0-or-later
"""Where Halfspace must not register it says why in one sentence, and Blender goes on."""

from __future__ import annotations

import types
from collections.abc import Iterator
from typing import Any

import bpy
import pytest

import addon
from addon import refusal


class Layout:
    """Collects the labels that are drawn."""

    def __init__(self) -> None:
        self.labels: list[str] = []

    def label(self, text: str, icon: str = "NONE") -> None:
        self.labels.append(text)


@pytest.fixture
def gone() -> Iterator[None]:
    """Without the extension, which the other tests need again."""
    addon.unregister()
    yield
    refusal.taken_back()
    addon.register()


def traces() -> list[str]:
    return sorted(name for name in dir(bpy.types) if "halfspace" in name.lower())


def in_another(version: tuple[int, ...]) -> Any:
    """Blender's module with another version."""
    app = types.SimpleNamespace(version=version)
    return types.SimpleNamespace(app=app, types=bpy.types, utils=bpy.utils)


def test_a_blender_that_is_too_old_is_told_so(
    gone: None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(refusal, "bpy", in_another((4, 2, 9)))
        addon.register()
    said = "Halfspace needs Blender 4.5 or newer, and this is Blender 4.2.9"
    assert capsys.readouterr().err == f"Halfspace: {said}\n"
    assert not hasattr(bpy.types.Scene, "halfspace")
    assert traces() == []
    layout = Layout()
    (kind,) = refusal._shown
    assert kind.is_registered
    assert kind.bl_idname == addon.__name__
    kind.draw(types.SimpleNamespace(layout=layout), bpy.context)
    assert layout.labels == [said]
    addon.unregister()
    assert not kind.is_registered


def test_the_oldest_blender_is_the_manifests() -> None:
    import tomllib
    from pathlib import Path

    manifest = tomllib.loads((Path(addon.__file__).parents[1] / "blender_manifest.toml").read_text(encoding="utf-8"))
    assert manifest["blender_version_min"] == ".".join(map(str, refusal.OLDEST))


def test_a_second_copy_is_refused_and_the_first_stays(capsys: pytest.CaptureFixture[str]) -> None:
    before = traces()
    assert refusal.reason("addon") is None
    assert refusal.refused("bl_ext.user_default.halfspace")
    said = capsys.readouterr().err
    assert said.startswith("Halfspace: Another copy of Halfspace is enabled (addon): disable one of the two")
    assert said.count("\n") == 1
    assert refusal.taken_back()
    assert not refusal.taken_back()
    assert traces() == before
    assert hasattr(bpy.types.Scene, "halfspace")


def test_a_package_with_a_longer_name_is_another_copy() -> None:
    assert refusal.reason("addo") is not None


def test_a_preset_that_cannot_be_saved_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    from bl_operators.presets import AddPresetBase

    def fail(self: Any, context: Any) -> set[str]:
        raise PermissionError(13, "Permission denied", "presets/mine.py")

    monkeypatch.setattr(AddPresetBase, "execute", fail)
    with pytest.raises(RuntimeError) as error:
        bpy.ops.halfspace.preset_add(name="mine")
    assert str(error.value).strip() == "Error: The preset cannot be saved: presets/mine.py: Permission denied"
