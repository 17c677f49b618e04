# SPDX-License-Identifier: GPL-3.0-or-later
"""The command that times extraction: that it measures what it says, never how long that took."""

import pytest

from scripts.dev import extraction


def test_every_scene_gets_a_row_with_its_size(capsys: pytest.CaptureFixture[str]) -> None:
    assert extraction.main(["--triangles", "800", "--rounds", "1"]) == 0
    rows = capsys.readouterr().out.splitlines()[1:]
    assert len(rows) == len(extraction.KINDS) + 1
    for kind, row in zip(extraction.KINDS, rows, strict=False):
        assert row.startswith(kind)
        assert int(row[len(kind) :].split()[0].replace(",", "")) >= 800
    assert "12,102 instances" in rows[-1]
    assert "kept" not in rows[-1]


def test_a_promise_is_kept_only_if_both_times_are_within_it() -> None:
    assert extraction._keeps(1_000_000, 0.29, 0.049)
    assert not extraction._keeps(1_000_000, 0.31, 0.049)
    assert not extraction._keeps(1_000_000, 0.29, 0.051)


def test_bad_usage_is_said_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert extraction.main(["--rounds", "0"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
