# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension is replaced by another version, or by another build of its own, in a Blender that runs."""

from pathlib import Path

import pytest

from tests.blender.installing.builds import STEPS, check_look, check_new_session, check_picture
from tests.blender.user_session import session


@pytest.mark.parametrize(
    ("first", "second", "busy"),
    [("old", "new", ""), ("new", "old", ""), ("new", "rebuilt", ""), ("old", "new", "busy")],
    ids=["upgrade", "downgrade", "same version", "during renders"],
)
def test_another_version_takes_over_in_the_same_session(
    zips: dict[str, str], tmp_path: Path, first: str, second: str, busy: str
) -> None:
    found = session(tmp_path, STEPS, "over", zips[first], zips[second], *([busy] if busy else []))
    assert found["installed"] == "", found["log"]
    assert "Traceback" not in found["log"]
    # The other version is there, and renders with its own native module at once.
    check_look(found["first"]["look"], first, tmp_path)
    check_look(found["second"]["look"], second, tmp_path)
    for mark in ("first", "second"):
        check_picture(found[mark]["picture"])
    assert found["kept"] == found["set"] == {"engine": "HALFSPACE", "samples": 3, "overlay": True}
    # Nothing is left of the one before: neither registered nor in memory.
    assert found["foreign"] == []
    assert found["left"] == []
    assert found["open"] == []
    if busy:
        assert found["picture ended"]
        assert found["view ended"]
    after = session(tmp_path, STEPS, "later")
    check_new_session(after, second, tmp_path)
    assert after["traces"] == found["second"]["traces"]
