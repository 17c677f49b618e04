# SPDX-License-Identifier: GPL-3.0-or-later
"""What holds for the sources as a whole."""

from __future__ import annotations

import ast
from typing import Any

import environment
import pytest

ROOT = environment.ROOT


@pytest.mark.parametrize("folder", ["addon", "distribution", "scripts", "tests"])
def test_nothing_needs_at_its_start_what_windows_has_not(folder: str) -> None:
    paths = sorted((ROOT / folder).rglob("*.py"))
    assert paths
    for path in paths:
        for line in ast.parse(path.read_text(encoding="utf-8")).body:
            names = [alias.name for alias in line.names] if isinstance(line, ast.Import) else []
            names += [line.module] if isinstance(line, ast.ImportFrom) else []
            assert not {"fcntl", "grp", "pwd", "resource", "termios"} & set(names), f"{path}:{line.lineno}"


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
