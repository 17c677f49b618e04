# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension is replaced by another version, or by another build of its own, in a Blender that runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from user_session import built_wheel, made_zip, other_build, session

STEPS = "installing/upgrade_steps.py"

PANEL_OF_THE_OLD = '''

class HALFSPACE_PT_old(EnginePanel, bpy.types.Panel):
    """A panel that the new version does not have."""

    bl_label = "Old"
    section = "Sampling"

    def draw(self, context: Any) -> None:
        """Draw nothing."""


register, unregister = bpy.utils.register_classes_factory((*CLASSES, HALFSPACE_PT_old))
'''

OLD = {
    "blender_manifest.toml": lambda text: text.replace('version = "0.1.0"', 'version = "0.0.9"'),
    "blender/render/engine.py": lambda text: text.replace('bl_label = "Halfspace"', 'bl_label = "Halfspace 0.0.9"'),
    "blender/ui/panels.py": lambda text: text.replace('bl_label = "Sampling"', 'bl_label = "Old"') + PANEL_OF_THE_OLD,
    "blender/settings/quality.py": lambda text: text.replace("Camera rays per pixel;", "Old rays;"),
}
"""What differs in the old version, in the text of its files."""


@pytest.fixture(scope="module")
def zips(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Zips by what they are: "old" of another version, "new", and "rebuilt" of the same version with another wheel."""
    folder = tmp_path_factory.mktemp("zips")
    wheels = {}
    for mark in ("old", "new", "rebuilt"):
        (folder / mark).mkdir()
        wheels[mark] = other_build(built_wheel(), folder / mark, mark)
    changes = {"old": OLD, "new": None, "rebuilt": None}
    return {mark: str(made_zip(folder, mark, wheels[mark], changes[mark])) for mark in wheels}


SEEN = {
    "old": {"engine": ["Halfspace 0.0.9"], "panel": "Old", "property": "Old rays;", "old_panel": True},
    "new": {"engine": ["Halfspace"], "panel": "Sampling", "property": "Camera rays per pixel;", "old_panel": False},
}
SEEN["rebuilt"] = SEEN["new"]


def check_look(look: dict[str, Any], mark: str, user: Path) -> None:
    """Fail unless Blender shows this version, with the native module of its own zip."""
    assert look["enabled"] == [True, True]
    seen = {key: look[key] for key in SEEN[mark]}
    seen["property"] = " ".join(seen["property"].split()[: len(SEEN[mark]["property"].split())])
    assert seen == SEEN[mark]
    assert look["build"] == mark
    assert Path(look["file"]).resolve().is_relative_to(user.resolve())


def check_picture(picture: dict[str, Any]) -> None:
    """Fail unless it shows something."""
    assert picture["error"] == ""
    assert picture["deviation"] > 0.01


@pytest.mark.parametrize(
    ("first", "second", "busy"),
    [("old", "new", ""), ("new", "old", ""), ("new", "rebuilt", ""), ("old", "new", "busy")],
    ids=["upgrade", "downgrade", "same version", "during renders"],
)
def test_another_version_takes_over_in_the_same_session(
    zips: dict[str, str], tmp_path: Path, first: str, second: str, busy: str
) -> None:
    found = session(tmp_path, STEPS, "over", zips[first], zips[second], *([busy] if busy else []))
    assert found["installed"] == "", found["log"]
    assert "Traceback" not in found["log"]
    # The other version is there, and renders with its own native module at once.
    check_look(found["first"]["look"], first, tmp_path)
    check_look(found["second"]["look"], second, tmp_path)
    for mark in ("first", "second"):
        check_picture(found[mark]["picture"])
    assert found["kept"] == found["set"] == {"engine": "HALFSPACE", "samples": 3, "overlay": True}
    # Nothing is left of the one before: neither registered nor in memory.
    assert found["foreign"] == []
    assert found["left"] == []
    if busy:
        assert found["picture ended"]
        assert found["view ended"]
    assert found["open"] == []
    # A new session has the same version, and no files of the other one.
    after = session(tmp_path, STEPS, "later")
    assert after["at start"] == [True, True], after["log"]
    assert "Traceback" not in after["log"]
    check_look(after["look"], second, tmp_path)
    check_picture(after["picture"])
    assert after["traces"] == found["second"]["traces"]
    packages = [name for name in after["unpacked"] if not name.endswith(".dist-info")]
    assert packages == [Path(after["look"]["file"]).parent.name]
    assert after["stale"] == []
