# SPDX-License-Identifier: GPL-3.0-or-later
"""The stability table: right structures show zeros, wrong ones are caught, closed surfaces hold."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import halfspace_native
import numpy as np
import pytest
import stability as command
from lying_native import LIES, LyingNative

from addon.core import leaks, stability

LIMIT = 1500


def small_case(name: str) -> dict:
    return next(case for case in halfspace_native.cases() if case["name"] == name)


def test_the_cases_cover_the_list_of_extremes() -> None:
    cases = halfspace_native.cases()
    names = [case["name"] for case in cases]
    assert len(names) == len(set(names))
    covered = {number for case in cases for number in case["extremes"]}
    # Flushed subnormals and thread counts are no scenes.
    assert covered == {f"X{n:02}" for n in range(1, 61)} - {"X57", "X58"}
    for case in cases:
        assert case["summary"]
        assert 0 < len(case["origins"]) == len(case["t_max"])
        assert np.isfinite(case["origins"]).all()
        assert len(case["triangles"]) <= LIMIT


def test_cases_are_functions_of_size_and_seed() -> None:
    first, again, other = (halfspace_native.cases(seed=seed) for seed in (7, 7, 8))
    for one, two in zip(first, again, strict=True):
        assert one["vertices"].tobytes() == two["vertices"].tobytes()
        assert one["origins"].tobytes() == two["origins"].tobytes()
    assert any(a["origins"].tobytes() != b["origins"].tobytes() for a, b in zip(first, other, strict=True))
    with pytest.raises(halfspace_native.SpecError, match="small or large, got huge"):
        halfspace_native.cases("huge")


def test_configurations_add_traversals_and_what_may_fail() -> None:
    rows = halfspace_native.structures()
    made = stability.configurations(rows, ["kd", "kd:max_depth=9,traversal=dir", "brute"])
    deep = "kd:max_depth=9,traversal=dir"
    own = ["kd", "kd:traversal=dir", "kd:robust=none", "kd:traversal=dir,robust=none"]
    assert made == [*own, deep, f"{deep},robust=none", "brute"]


@pytest.mark.parametrize("lie", LIES)
def test_a_lie_is_told(lie: str) -> None:
    case = small_case("random soup")
    honest = list(stability.measure_case(halfspace_native, case, ["kd"], exact_pairs=1000, threads=1))
    lying = list(stability.measure_case(LyingNative(lie), case, ["kd"], exact_pairs=1000, threads=1))
    assert not stability.differs(honest[0])
    assert stability.differs(lying[0])


def test_textbook_traversals_fail_and_ours_do_not(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status = command.main(["--structures", "kd", "--leak-rays", "400", "--out", str(tmp_path)])
    assert status == 0
    document = json.loads((tmp_path / "stability.json").read_text(encoding="utf-8"))
    none = [row for row in document["rows"] if "robust=none" in row["spec"]]
    assert any(stability.differs(row) for row in none)
    assert "fewer than" in document["verdict"]
    with (tmp_path / "stability.csv").open(encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == len(document["rows"])
    page = (tmp_path / "stability.html").read_text(encoding="utf-8")
    assert "touching boxes" in page
    assert "http" not in page
    assert "leaks of kd" in capsys.readouterr().out


def test_a_wrong_structure_sets_the_status(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stability, "allowed_to_fail", lambda spec: False)
    assert command.main(["--structures", "kd:robust=none", "--leak-rays", "0"]) == 1


@pytest.mark.parametrize("bad", [["--structures", "tree"], ["--rays", "-1"], ["--size", "huge"], ["--rays", "x"]])
def test_bad_usage_is_one_line(bad: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(bad) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_long_run_ends_when_enough_rays_agree() -> None:
    said: list[str] = []
    rows = stability.run_until(halfspace_native, ["kd", "kd:robust=none"], 60_000, "small", 3, said.append)
    kd = next(row for row in rows if row["spec"] == "kd")
    assert kd["rays"] >= 60_000
    assert not stability.differs(kd)
    assert stability.limit(rows).startswith(f"no difference in {kd['rays']:,} rays")


@pytest.mark.parametrize("row", halfspace_native.structures(), ids=lambda row: row["id"])
def test_closed_surfaces_hold(row: dict) -> None:
    for spec in stability.configurations([row], [row["id"]]):
        if not stability.allowed_to_fail(spec):
            assert not any(leaks.count_leaks(halfspace_native, spec, 2, 2000).values()), spec


def test_a_hole_is_a_leak() -> None:
    vertices, triangles = leaks.icosphere(2)
    assert len(triangles) == 20 * 16
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    points = vertices.astype(np.float32)
    rng = np.random.default_rng(1)
    origins, directions = leaks.rays_from_inside(points, triangles, np.zeros(3), 0.3, 4000, rng)
    holed = halfspace_native.build(points, triangles[1:], "kd")
    assert not holed.occluded(origins, directions).all()
