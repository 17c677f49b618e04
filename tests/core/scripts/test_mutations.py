# SPDX-License-Identifier: GPL-3.0-or-later
"""The deliberate faults fit the sources, and the command lists those that no test notices."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from scripts.dev import mutations
from scripts.dev.deliberate_faults import FAULTS, Fault


def test_every_fault_has_its_place() -> None:
    mutations.check()
    assert len({fault.what for fault in FAULTS}) == len(FAULTS) >= 15


def test_a_fault_without_a_place_is_told() -> None:
    fault = Fault("gone", "native/x.rs", "a + b", "a - b", ("lib", "x"))
    with pytest.raises(mutations.StaleError, match="occurs 0 times"):
        mutations.seeded("a * b", fault, 1)
    with pytest.raises(mutations.StaleError, match="2 times"):
        mutations.seeded("a + b; a + b", fault, 1)
    assert mutations.seeded("y = a + b;", fault, 7) == "y = (if crate::fault(7) { a - b } else { a + b });"


@pytest.mark.parametrize("part", ["[a + b", "a + b,", "f(a + b))"])
def test_a_fault_in_a_part_of_an_expression_is_told(part: str) -> None:
    for old, new in ((part, "a"), ("a", part)):
        with pytest.raises(mutations.StaleError, match="part of an expression"):
            mutations.seeded(old, Fault("half", "native/x.rs", old, new, ("lib", "x")), 1)


def seed_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch, body: str, listed: str) -> Fault:
    """Replace the build by a shell script that lists `listed` and else does `body`. Returns a fault."""
    program = folder / "program"
    program.write_text(f'#!/bin/sh\nif [ "$2" = --list ]; then echo {listed}; exit; fi\n{body}\n')
    program.chmod(0o700)
    (folder / "native").mkdir()
    monkeypatch.setattr(mutations, "seed", lambda _: None)
    monkeypatch.setattr(mutations, "build", lambda _copy, _faults: {"lib": [program]})
    return Fault("minus", "native/x.rs", "a + b", "a - b", ("lib", "x"))


@pytest.mark.skipif(os.name == "nt", reason="the script needs a shell")
def test_a_fault_without_a_test_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fault = seed_nothing(tmp_path, monkeypatch, "true", "0 tests, 0 benchmarks")
    with pytest.raises(mutations.StaleError, match="no test is named lib x"):
        mutations.run(tmp_path, [(1, fault)])


@pytest.mark.skipif(os.name == "nt", reason="the script needs a shell")
@pytest.mark.parametrize(("condition", "survived"), [("false", [1]), ("[ $HALFSPACE_FAULT = 1 ]", []), ("true", [0])])
def test_a_survivor_is_told(
    condition: str, survived: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    fault = seed_nothing(tmp_path, monkeypatch, f"! {condition}", "x::adds: test")
    assert mutations.run(tmp_path, [(1, fault)]) == survived
    told = capsys.readouterr().out
    assert ("SURVIVED" in told) == (survived == [1])
    assert ("FAILS without any fault" in told) == (survived == [0])
