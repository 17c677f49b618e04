# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows locks the file of the loaded native module: Blender cannot remove it before its next start."""

import sys
from pathlib import Path

import pytest

from tests.blender.installing.builds import STEPS, check_look, check_new_session, check_picture
from tests.blender.user_session import INSIDE, session

FOLDERS = pytest.mark.parametrize("folders", ["folders", "file"])
"""Things that cannot be renamed: the folders of the locked file too, or nothing."""


@FOLDERS
def test_a_locked_module_does_not_hinder_another_version(zips: dict[str, str], tmp_path: Path, folders: str) -> None:
    found = session(tmp_path, STEPS, "locked", folders, zips["old"], zips["new"])
    assert found["reported"] == ["", ""], found["log"]
    assert "Traceback" not in found["log"]
    for mark, look, picture in zip(("old", "new"), found["looks"], found["pictures"], strict=True):
        check_look(look, mark, tmp_path)
        check_picture(picture)
    assert found["kept"] == {"engine": "HALFSPACE", "samples": 3, "overlay": True}
    assert found["foreign"] == []
    assert found["there"]
    check_new_session(session(tmp_path, STEPS, "later"), "new", tmp_path)


@pytest.mark.parametrize(
    ("folders", "steps"),
    [("folders", ("new", "new")), ("file", ("new", "new")), ("folders", ("old", "new", "old"))],
    ids=["disable and enable", "disable and enable, file alone", "there and back"],
)
def test_a_locked_module_that_is_unpacked_again_works_at_once_and_at_the_next_start(
    zips: dict[str, str], tmp_path: Path, folders: str, steps: tuple[str, ...]
) -> None:
    found = session(tmp_path, STEPS, "locked", folders, *(zips[mark] for mark in steps))
    # Blender reports the file that it could not write, in its own words; the loaded module goes on.
    reported = [text for text in found["reported"] if text]
    assert all("denied" in text.lower() for text in reported), found["log"]
    assert "halfspace/__init__.py" not in found["log"].replace("\\", "/"), "a traceback through the extension"
    for mark, look, picture in zip(steps, found["looks"], found["pictures"], strict=True):
        check_look(look, mark, tmp_path)
        check_picture(picture)
    assert found["there"]
    check_new_session(session(tmp_path, STEPS, "later"), steps[-1], tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows itself locks the file")
def test_the_file_is_locked_here(tmp_path: Path) -> None:
    import subprocess

    script = "import sys, os, shutil, locking; path = sys.argv[1]\n"
    script += "locking.lock(path, True); found = []\n"
    script += "for call in (lambda: os.remove(path), lambda: open(path, 'wb'), lambda: shutil.rmtree(sys.argv[2]),\n"
    script += "             lambda: os.rename(sys.argv[2], sys.argv[2] + '2')):\n"
    script += "    try: call()\n"
    script += "    except PermissionError: found.append('refused')\n"
    script += "os.rename(path, path + '2'); print(found, locking.still_there())\n"
    (tmp_path / "folder").mkdir()
    file = tmp_path / "folder" / "module.so"
    file.write_bytes(b"loaded")
    command = [sys.executable, "-c", script, str(file), str(file.parent)]
    done = subprocess.run(command, cwd=INSIDE, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "['refused', 'refused', 'refused', 'refused'] True"
    assert (tmp_path / "folder" / "module.so2").read_bytes() == b"loaded"
