# SPDX-License-Identifier: GPL-3.0-or-later
"""Finished rows survive, and files are whole or not there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import halfspace_native
import pytest

from addon.core import results


def test_rows_come_back(tmp_path: Path) -> None:
    first = results.Journal(tmp_path)
    first.add("a", {"x": 1})
    first.add("b", {"x": 2})
    assert results.Journal(tmp_path).rows == {"a": {"x": 1}, "b": {"x": 2}}


@pytest.mark.parametrize("cut", [1, 8, 20])
def test_a_half_written_last_line_loses_only_itself(tmp_path: Path, cut: int) -> None:
    journal = results.Journal(tmp_path)
    journal.add("a", {"x": 1})
    journal.add("b", {"x": 2})
    file = tmp_path / results.JOURNAL
    file.write_bytes(file.read_bytes()[:-cut])
    again = results.Journal(tmp_path)
    assert again.rows["a"] == {"x": 1}
    again.add("c", {"x": 3})
    assert results.Journal(tmp_path).rows["c"] == {"x": 3}


def test_rubbish_in_the_journal_is_passed_over(tmp_path: Path) -> None:
    (tmp_path / results.JOURNAL).write_text('nonsense\n[]\n{"key": "a"}\n{"key": "b", "row": {"x": 1}}\n')
    assert results.Journal(tmp_path).rows == {"b": {"x": 1}}


def test_a_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "bench.json"
    results.write(path, "old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(results.os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        results.write(path, "new")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path], "no remains"


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(results.FolderError, match="file/inside: cannot be written"):
        results.prepare_folder(file / "inside")


def test_a_key_depends_on_every_part() -> None:
    parts: list[Any] = ["scene", "kd", {"size": [64, 64], "seed": 1}]
    base = results.key(*parts)
    assert results.key(*json.loads(json.dumps(parts))) == base
    assert results.key("scene", "kd", {"seed": 1, "size": [64, 64]}) == base
    assert results.key("scene", "kd", {"seed": 2, "size": [64, 64]}) != base
    assert results.key("scene", "kd-sah", parts[2]) != base


def test_the_native_fingerprint_is_that_of_the_module() -> None:
    found = results.native_fingerprint(halfspace_native)
    assert found == results.native_fingerprint(halfspace_native)
    empty = type("Empty", (), {"__file__": "/nowhere/x.py", "__version__": halfspace_native.__version__})
    assert found != results.native_fingerprint(empty)
