# SPDX-License-Identifier: GPL-3.0-or-later
"""Promises of the manifest, against what the modules do."""

import re
import tomllib
from pathlib import Path

from scripts import package

ROOT = Path(__file__).resolve().parents[3]
MANIFEST = ROOT / "blender_manifest.toml"

TOUCHES_THE_DISK = re.compile(r"import tempfile|import subprocess|AddPresetBase|results\.writ|savez|\.save\(")


def test_whatever_touches_the_disk_or_starts_a_program_is_told() -> None:
    text = MANIFEST.read_text(encoding="utf-8")
    told = text[text.index("[permissions]") :]
    found = [path.stem for path in (ROOT / "addon/blender").rglob("*.py") if TOUCHES_THE_DISK.search(path.read_text())]
    assert {"compare_files", "lettering", "presets", "sky", "sky_bake"} <= set(found)
    assert [name for name in found if f"{name}.py" not in told] == []
    for words in ("report", "preset", "temporary"):
        assert words in tomllib.loads(text)["permissions"]["files"].lower()


def test_blender_takes_the_manifest(tmp_path: Path) -> None:
    reasons = tomllib.loads(MANIFEST.read_text(encoding="utf-8"))["permissions"]
    assert all(len(reason) <= 64 and reason[-1].isalnum() for reason in reasons.values())
    (tmp_path / "blender_manifest.toml").write_bytes(MANIFEST.read_bytes())
    (tmp_path / "__init__.py").touch()
    package.run_tool("validate", str(tmp_path))
