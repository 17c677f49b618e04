# SPDX-License-Identifier: GPL-3.0-or-later
"""The wheels in the extension have their build in their names, and are whole."""

from __future__ import annotations

import importlib
import importlib.metadata
import sys
import zipfile
from pathlib import Path

import pytest

from scripts.dev import environment
from scripts.systems import bundled

NAMES = [f"x-1.2.3-cp311-abi3-{tag}.whl" for tag in ("linux_x86_64", "win_amd64")]


def made(path: Path, content: str = "N = 1\n") -> Path:
    """A wheel with a package, the files of its distribution, and a module next to the package."""
    path.parent.mkdir(exist_ok=True)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("x/__init__.py", content)
        archive.writestr("x/sub/x.py", "")
        archive.writestr("xy.py", "")
        archive.writestr("x-1.2.3.dist-info/METADATA", "Metadata-Version: 2.4\nName: x\nVersion: 1.2.3\n\nName: text\n")
        archive.writestr("x-1.2.3.dist-info/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr("x-1.2.3.dist-info/RECORD", "x/__init__.py,,\n")
    return path


def test_the_build_is_in_the_names_of_distribution_and_package(tmp_path: Path) -> None:
    wheels = [made(tmp_path / name) for name in NAMES]
    build = bundled.build_of(wheels)
    (tmp_path / "out").mkdir()
    assert bundled.bundle(wheels, tmp_path / "out") == [
        tmp_path / "out" / name.replace("x-", f"x_{build}-", 1) for name in NAMES
    ]
    with zipfile.ZipFile(tmp_path / "out" / NAMES[0].replace("x-", f"x_{build}-", 1)) as archive:
        inside = archive.namelist()
        metadata = archive.read(f"x_{build}-1.2.3.dist-info/METADATA").decode()
    places = [f"x_{build}/__init__.py", f"x_{build}/sub/x.py", "xy.py"]
    assert inside == places + [f"x_{build}-1.2.3.dist-info/{name}" for name in ("METADATA", "WHEEL", "RECORD")]
    assert metadata == f"Metadata-Version: 2.4\nName: x_{build}\nVersion: 1.2.3\n\nName: text\n"


def test_the_build_is_that_of_the_content_alone(tmp_path: Path) -> None:
    wheel = made(tmp_path / NAMES[0])
    before = bundled.build_of([wheel])
    copy = made(tmp_path / "copy" / NAMES[0])
    assert bundled.build_of([copy]) == before
    assert bundled.build_of([wheel, made(tmp_path / NAMES[1])]) != before
    assert bundled.build_of([made(copy, "N = 2\n")]) != before
    assert bundled.build_of([made(tmp_path / NAMES[1])]) != before, "another name"


def test_an_installer_takes_the_renamed_wheel_by_its_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "out").mkdir()
    (wheel,) = bundled.bundle([made(tmp_path / "x-1.2.3-py3-none-any.whl")], tmp_path / "out")
    there = tmp_path / "there"
    options = ["--offline", "--no-deps", "--python", sys.executable, "--target", str(there)]
    environment.uv(["pip", "install", *options, str(wheel)], "the wheel is not installed")
    monkeypatch.syspath_prepend(str(there))
    name = wheel.name.partition("-")[0]
    assert importlib.import_module(name).N == 1
    assert importlib.metadata.version(name) == "1.2.3"
