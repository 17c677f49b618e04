# SPDX-License-Identifier: GPL-3.0-or-later
"""The libraries of the system that Blender needs: what is missing is found, and installed or told."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import pytest
import system_libraries

LDD = """\
\tlinux-vdso.so.1 (0x00007ffe)
\tlibX11.so.6 => /lib/x86_64-linux-gnu/libX11.so.6 (0x00007f1)
\tlibXfixes.so.3 => not found
\tlibSM.so.6 => not found
\tlibodd.so.9 => not found
\tlibSM.so.6 => not found
"""


def test_missing_libraries_are_read_off_and_named_as_packages() -> None:
    names = system_libraries.parse_ldd(LDD)
    assert names == ["libSM.so.6", "libXfixes.so.3", "libodd.so.9"]
    assert system_libraries.packages(names) == ["libodd.so.9", "libsm6", "libxfixes3"]


def test_without_the_right_to_install_the_command_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(system_libraries, "missing", lambda _: ["libSM.so.6"])
    monkeypatch.setattr(system_libraries, "may_install", lambda: False)
    with pytest.raises(system_libraries.MissingLibrariesError, match=r"sudo apt-get install .* libsm6"):
        system_libraries.provide(tmp_path)


def test_with_the_right_they_are_installed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    answers = iter([["libSM.so.6"], []])
    monkeypatch.setattr(system_libraries, "missing", lambda _: next(answers))
    monkeypatch.setattr(system_libraries, "may_install", lambda: True)
    commands: list[list[str]] = []

    def run(command: list[str], **_: Any) -> Any:
        commands.append(command)
        return subprocess.CompletedProcess(command, 0, "", "")

    monkeypatch.setattr(system_libraries.subprocess, "run", run)
    assert system_libraries.provide(tmp_path) == ["libsm6"]
    assert commands[0] == ["apt-get", "update"]
    assert commands[1][-1] == "libsm6"


def test_a_failed_installation_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(system_libraries, "missing", lambda _: ["libSM.so.6"])
    monkeypatch.setattr(system_libraries, "may_install", lambda: True)
    failed = subprocess.CompletedProcess([], 100, "", "E: Unable to fetch some archives")
    monkeypatch.setattr(system_libraries.subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(system_libraries.MissingLibrariesError, match="Unable to fetch"):
        system_libraries.provide(tmp_path)


def test_the_installed_blender_lacks_nothing() -> None:
    bpy = pytest.importorskip("bpy", reason="Blender's module bpy is not installed in this environment")
    folder = next(p for p in Path(bpy.__file__).parents if p.name == "bpy" and any(p.glob("__init__*.so")))
    assert system_libraries.missing(folder) == []
