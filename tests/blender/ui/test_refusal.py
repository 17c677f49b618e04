# SPDX-License-Identifier: GPL-3.0-or-later
"""Where Halfspace must not register or cannot write; see tests/blender/installing for what users see of it."""

import tomllib
from pathlib import Path
from typing import Any

import bpy
import pytest

import addon
from addon import refusal


def test_the_oldest_blender_is_the_manifests() -> None:
    manifest = tomllib.loads((Path(addon.__file__).parents[1] / "blender_manifest.toml").read_text(encoding="utf-8"))
    assert manifest["blender_version_min"] == ".".join(map(str, refusal.OLDEST))


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
