# SPDX-License-Identifier: GPL-3.0-or-later
"""Zips of an old version, of the new one, and of a second build of the new one; and how each looks in Blender."""

from pathlib import Path
from typing import Any

from tests.blender.user_session import built_wheel, made_zip, other_build

STEPS = "upgrade"

PANEL_OF_THE_OLD = '''

class HALFSPACE_PT_old(EnginePanel, bpy.types.Panel):
    """A panel that the new version does not have."""

    bl_label = "Old"
    section = "Sampling"

    def draw(self, context: Any) -> None:
        """Draw nothing."""


CLASSES = (*CLASSES, HALFSPACE_PT_old)
'''

OLD = {
    "blender_manifest.toml": lambda text: text.replace('version = "0.1.0"', 'version = "0.0.9"'),
    "blender/render/engine.py": lambda text: text.replace('bl_label = "Halfspace"', 'bl_label = "Halfspace 0.0.9"'),
    "blender/ui/panels.py": lambda text: text.replace('bl_label = "Sampling"', 'bl_label = "Old"') + PANEL_OF_THE_OLD,
    "blender/settings/quality.py": lambda text: text.replace("Camera rays per pixel;", "Old rays;"),
}
"""Differences of the old version, in the text of its files."""

SEEN = {
    "old": {"engine": ["Halfspace 0.0.9"], "panel": "Old", "property": "Old rays;", "old_panel": True},
    "new": {"engine": ["Halfspace"], "panel": "Sampling", "property": "Camera rays per pixel;", "old_panel": False},
}
SEEN["rebuilt"] = SEEN["new"]
"""Texts that Blender shows of each; of the property, how its description begins."""


def zips(folder: Path) -> dict[str, str]:
    """Their paths by what they are: "old" of another version, "new", and "rebuilt" of the same with another wheel."""
    found = {}
    for mark, changes in (("old", OLD), ("new", None), ("rebuilt", None)):
        (folder / mark).mkdir()
        wheel = other_build(built_wheel(), folder / mark, mark)
        found[mark] = str(made_zip(folder, mark, wheel, changes))
    return found


def check_look(look: dict[str, Any], mark: str, user: Path) -> None:
    """Fail unless Blender shows this version, with the native module of its own zip."""
    assert look["enabled"] == [True, True]
    seen = {key: look[key] for key in SEEN[mark]}
    seen["property"] = seen["property"][: len(SEEN[mark]["property"])]
    assert seen == SEEN[mark]
    assert look["build"] == mark
    assert Path(look["file"]).resolve().is_relative_to(user.resolve())


def check_picture(picture: dict[str, Any]) -> None:
    """Fail unless it shows something."""
    assert picture["error"] == ""
    assert picture["deviation"] > 0.01


def check_new_session(after: dict[str, Any], mark: str, user: Path) -> None:
    """Fail unless the next start has this version, renders, and has no files of another one."""
    assert after["at start"] == [True, True], after["log"]
    assert "Traceback" not in after["log"]
    check_look(after["look"], mark, user)
    check_picture(after["picture"])
    assert Path(after["look"]["file"]).is_file()
    packages = [name for name in after["unpacked"] if not name.endswith(".dist-info")]
    assert packages == [Path(after["look"]["file"]).parent.name]
    assert after["stale"] == []
