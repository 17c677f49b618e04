# SPDX-License-Identifier: GPL-3.0-or-later
"""Zips that cannot work in this Blender are installed by it: each gives one sentence, and Blender goes on."""

import platform
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from tests.blender.installing.builds import check_picture
from tests.blender.user_session import built_wheel, for_system, made_zip, session

STEPS = "refused"
ELSEWHERE = (
    ("manylinux_2_28_aarch64", "Linux on ARM") if sys.platform == "win32" else ("win_amd64", "Windows on x86-64")
)
"""The tag of a system that this one is not, and its name in messages."""


def zip_of(folder: Path, wheel: Path, changes: Mapping[str, Callable[[str], str]] | None = None) -> str:
    """A zip of the repository with this wheel."""
    return str(made_zip(folder, "made", wheel, changes))


def user(folder: Path) -> Path:
    """An empty user folder."""
    made = folder / "user"
    made.mkdir()
    return made


def check_goes_on(found: dict[str, Any]) -> None:
    """Fail unless Blender rendered afterwards, and printed no traceback."""
    check_picture(found["cycles"])
    assert "Traceback" not in found["log"]


def check_refused(found: dict[str, Any], said: str) -> None:
    """Fail unless the installer printed one such sentence and installed nothing."""
    lines = [line for line in found["log"].splitlines() if line.startswith("ERROR")]
    assert len(lines) == 1, found["log"]
    assert re.fullmatch(f"ERROR halfspace: {said}", lines[0])
    assert found["enabled"] == [False, False]
    check_goes_on(found)


def test_blender_refuses_a_zip_for_another_system(tmp_path: Path) -> None:
    archive = zip_of(tmp_path, for_system(tmp_path, ELSEWHERE[0]))
    found = session(user(tmp_path), STEPS, "refused", archive)
    check_refused(found, r"This platform \([\w-]+\) isn't one of \([\w-]+\)")


def test_a_wheel_for_another_system_is_one_sentence(tmp_path: Path) -> None:
    changes = {"blender_manifest.toml": lambda text: re.sub(r"(?m)^platforms = .*$", "", text)}
    archive = zip_of(tmp_path, for_system(tmp_path, ELSEWHERE[0]), changes)
    found = session(user(tmp_path), STEPS, "without_module", archive)
    assert found["reported"] == ""
    assert found["enabled"] == [True, True]
    said = rf"This copy of Halfspace is for {ELSEWHERE[1]}, but this Blender runs [\w ().-]+: install the zip for this "
    assert re.fullmatch(said + "system", found["problem"])
    assert found["problem"] in found["picture"]["error"]
    assert found["loaded"] == []
    check_goes_on(found)


def test_blender_refuses_a_zip_for_a_newer_one(tmp_path: Path) -> None:
    changes = {"blender_manifest.toml": lambda text: text.replace('min = "4.5.0"', 'min = "99.1.0"')}
    found = session(user(tmp_path), STEPS, "refused", zip_of(tmp_path, built_wheel(), changes))
    check_refused(found, r"This Blender version \([\d.]+\) doesn't meet the minimum supported version \(99\.1\.0\)")


def test_a_blender_that_is_too_old_for_what_is_installed_is_one_sentence(tmp_path: Path) -> None:
    changes = {"refusal.py": lambda text: text.replace("OLDEST = (4, 5, 0)", "OLDEST = (99, 1, 0)")}
    found = session(user(tmp_path), STEPS, "unregistered", zip_of(tmp_path, built_wheel(), changes))
    assert found["reported"] == ""
    (said,) = found["shown"]
    assert re.fullmatch(r"Halfspace needs Blender 99\.1 or newer, and this is Blender \d+\.\d+\.\d+", said)
    assert found["log"].count(f"Halfspace: {said}\n") == 1
    assert not found["settings"]
    check_goes_on(found)


def test_a_second_copy_in_another_repository_is_one_sentence(tmp_path: Path, zips: dict[str, str]) -> None:
    found = session(user(tmp_path), STEPS, "both", zips["new"], zips["rebuilt"])
    assert found["reported"] == [""] * 5, found["log"]
    assert found["enabled"] == [[True, True], [True, True]]
    (said,) = found["shown"]
    assert said == (
        "Another copy of Halfspace is enabled (bl_ext.user_default.halfspace): "
        "disable one of the two, then enable the other again"
    )
    assert found["log"].count(f"Halfspace: {said}\n") == 1
    # The first copy works on, with its own native module, until the second is enabled alone.
    assert (found["build"], found["second build"]) == ("new", "rebuilt")
    assert found["second shown"] == []
    check_picture(found["picture"])
    check_picture(found["second picture"])
    check_goes_on(found)


@pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64", reason="what the processor reports is replaced in /proc"
)
def test_a_processor_without_sse42_is_one_sentence(tmp_path: Path) -> None:
    found = session(user(tmp_path), STEPS, "old_processor", zip_of(tmp_path, built_wheel()))
    assert found["reported"] == ""
    assert found["problem"] == "Halfspace needs a processor with SSE4.2, as Blender does, and this one does not have it"
    assert found["problem"] in found["picture"]["error"]
    assert found["loaded"] == [], "loading the module there would end Blender"
    check_goes_on(found)
