# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip that users install: built, installed by Blender itself into an empty user folder, rendered, and removed."""

import os
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from scripts import package
from tests.blender.user_session import built_wheel, session

STEPS = "extension"


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The zip with the wheel that the environment was set up with."""
    (made,) = package.package([built_wheel()], tmp_path_factory.mktemp("zip"))
    return made


@pytest.fixture(scope="module")
def found(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Findings of the user's Blender while it installed, rendered, disabled and enabled."""
    return session(tmp_path_factory.mktemp("user"), STEPS, "first_use", str(archive))


def test_the_zip_holds_the_addon_at_its_top_and_nothing_foreign(archive: Path) -> None:
    names = set(zipfile.ZipFile(archive).namelist())
    assert {"__init__.py", "blender_manifest.toml", "LICENSE", "manual.md"} <= names
    assert len([name for name in names if name.startswith("wheels/") and name.endswith(".whl")]) == 1
    foreign = ("lab/", "__pycache__", ".pyc", ".so", ".rs")
    assert not [name for name in names if any(word in name for word in foreign)]


def test_the_zip_installs_and_its_engine_renders(found: dict[str, Any]) -> None:
    assert found["enabled"] == found["again"] == [True, True], found["log"]
    assert Path(found["native"]).resolve().is_relative_to(Path(found["user"]).resolve())
    for picture in (found["first"], found["second"]):
        assert 0.01 < picture["mean"] < 0.99, found["log"]
        assert picture["deviation"] > 0.01, "the picture is of one colour"


def test_enabling_adds_what_disabling_takes_away(found: dict[str, Any]) -> None:
    assert found["with"]["properties"], "the probe sees what an enabled extension adds"
    assert found["with"]["types"]
    assert found["disabled"] == [False, False]
    assert found["after"] == found["before"]
    assert found["with_again"] == found["with"]


READ_ONLY = 'mount --bind "$0" "$0" && mount -o remount,ro,bind "$0" && exec "$@"'
"""Shell: make the folder $0 read-only, then run a command. Root writes where permissions forbid it."""


@pytest.fixture
def guard(found: dict[str, Any]) -> Iterator[list[str]]:
    """The command before one to which the user's folder is read-only; takes the permission to write for the test."""
    user = Path(found["user"])
    if sys.platform == "linux" and os.geteuid() == 0:
        words = ["unshare", "--mount", "sh", "-c", READ_ONLY, str(user)]
        if subprocess.run([*words, "true"], capture_output=True, check=False).returncode != 0:
            pytest.skip("no folder can be made read-only: this root may not mount")
        yield words
        return
    folders = [user, *(path for path in user.rglob("*") if path.is_dir())]
    modes = [path.stat().st_mode for path in folders]
    for path in folders:
        path.chmod(0o555)
    yield []
    for path, mode in zip(folders, modes, strict=True):
        path.chmod(mode)


@pytest.mark.skipif(os.name == "nt", reason="Windows ignores the permissions of folders")
def test_a_read_only_folder_keeps_the_engine_working(
    found: dict[str, Any], archive: Path, guard: list[str], tmp_path: Path
) -> None:
    seen = session(Path(found["user"]), STEPS, "read_only", str(archive), str(tmp_path / "picture.png"), before=guard)
    assert not seen["writable"], "the folder can be written"
    assert seen["enabled"] == [True, True], seen["log"]
    for picture in (seen["picture"], seen["still"]):
        assert picture["deviation"] > 0.01, seen["log"]
    assert "The preset cannot be saved" in seen["preset"]
    assert seen["install"], "Blender installed into a folder that cannot be written"
    assert "Traceback" not in seen["log"]
