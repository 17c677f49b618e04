# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of deliberate faults fits the sources, and the command tells what a test did not notice."""

from __future__ import annotations

from pathlib import Path

import mutations
import pytest
from deliberate_faults import FAULTS, table
from fault import Fault


def test_every_fault_has_its_place_and_its_line_in_the_list() -> None:
    mutations.check()
    assert mutations.LIST.read_text(encoding="utf-8") == table()
    assert len({fault.what for fault in FAULTS}) == len(FAULTS) >= 15


def test_a_fault_without_a_place_is_told() -> None:
    fault = Fault("gone", "native/x.rs", "a + b", "a - b", ("lib", "x"))
    with pytest.raises(mutations.StaleError, match="stands 0 times"):
        mutations.seeded("a * b", fault, 1)
    with pytest.raises(mutations.StaleError, match="2 times"):
        mutations.seeded("a + b; a + b", fault, 1)
    assert mutations.seeded("y = a + b;", fault, 7) == "y = (if crate::fault(7) { a - b } else { a + b });"


@pytest.mark.parametrize("part", ["[a + b", "a + b,", "f(a + b))"])
def test_a_fault_in_a_part_of_an_expression_is_told(part: str) -> None:
    for old, new in ((part, "a"), ("a", part)):
        with pytest.raises(mutations.StaleError, match="part of an expression"):
            mutations.seeded(old, Fault("half", "native/x.rs", old, new, ("lib", "x")), 1)


TEST = """
import sys
from pathlib import Path
sys.path.insert(0, str(Path(__file__).parents[2]))
from addon.core import thing
def test_sum(): assert thing.add(1, 2) == 3
def test_nothing(): pass
"""


@pytest.mark.parametrize(("name", "survived"), [("test_nothing", [1]), ("test_of_no_name", [0])])
def test_a_survivor_is_told(name: str, survived: list[int], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for folder in ("addon/core", "tests/core"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "addon/core/thing.py").write_text("def add(a, b):\n    return a + b\n")
    (tmp_path / "tests/core/test_thing.py").write_text(TEST)
    (tmp_path / "tests/run.py").write_text("import sys, pytest\nsys.exit(pytest.main(sys.argv[1:]))\n")
    fault = Fault("minus", "addon/core/thing.py", "a + b", "a - b", ("tests/core/test_thing.py", name))
    assert mutations.run(tmp_path, [(1, fault)]) == survived
    told = capsys.readouterr().out
    assert ("SURVIVED" in told) == (survived == [1])
    assert ("FAILS without any fault" in told) == (survived == [0])
