# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that write pictures where there is no room for them: the old pictures stay, and one line says so."""

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from addon.blender.measure import pictures
from addon.core.report import results
from addon.lab.commands import compare
from tests import little_room

pytestmark = pytest.mark.skipif(importlib.util.find_spec("resource") is None, reason="no file's size can be limited")


@pytest.mark.parametrize(
    ("room", "command", "name", "told"),
    [
        (4096, ["render", "--samples", "1", "--percentage", "10"], "picture.png", "picture.png"),
        (4096, ["compare", "--scene", "cornell", "--size", "96x96"], "cornell-halfspace.png", "picture.exr"),
    ],
)
def test_the_old_picture_stays(tmp_path: Path, room: int, command: list[str], name: str, told: str) -> None:
    old = tmp_path / name
    old.write_bytes(b"old")
    is_render = command[0] == "render"
    arguments = [*command[1:], "--out", str(old if is_render else tmp_path)]
    if not is_render:
        arguments += ["--samples", "2", "--runs", "2"]
    done = little_room.run(room, command[0], arguments)
    last = done.stderr.splitlines()[-1]
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert last.startswith(f"{command[0]}: ")
    assert told in last
    assert "incomplete" in last
    assert old.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [old]


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "displayed.png"])
def test_a_saved_picture_is_whole_or_the_old_one(scene: Any, name: str, tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    path = tmp_path / name
    path.write_bytes(b"old")

    def save() -> None:
        if name.startswith("displayed"):
            pictures.save_displayed(path, noise, scene)
        else:
            pictures.save(path, noise)

    noise = np.random.default_rng(1).uniform(0, 1, (64, 64, 3)).astype(np.float32)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1024, hard))
    try:
        with pytest.raises(OSError, match="cannot be written") as told:
            save()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert str(path) in str(told.value)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_cannot_be_written_is_found_before_any_render(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def never(*_: object) -> object:
        raise AssertionError("something was rendered")

    monkeypatch.setattr(compare, "_render_both", never)
    monkeypatch.setattr(results.tempfile, "TemporaryFile", _refused)
    assert compare.main(["--scene", "cornell", "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"compare: {tmp_path}: cannot be written: Read-only file system\n"


def _refused(**_: object) -> object:
    raise OSError(30, "Read-only file system")
