# SPDX-License-Identifier: GPL-3.0-or-later
"""What holds for the sources as a whole."""

from __future__ import annotations

from typing import Any

import environment

ROOT = environment.ROOT


def test_the_versions_in_all_files_are_one() -> None:
    import tomllib

    from addon.core.base import native

    def read(name: str) -> dict[str, Any]:
        return tomllib.loads((ROOT / name).read_text(encoding="utf-8"))

    versions = {
        "project": read("pyproject.toml")["project"]["version"],
        "crates": read("native/Cargo.toml")["workspace"]["package"]["version"],
        "manifest": read("blender_manifest.toml")["version"],
    }
    assert set(versions.values()) == {native.VERSION}, versions
