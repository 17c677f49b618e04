# SPDX-License-Identifier: GPL-3.0-or-later
"""How time grows: the surface, the rays, the fits, and that no time stands beside a wrong answer."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import halfspace_native
import numpy as np
import pytest
from lying_native import LIES, Lying

from addon.core.base import native
from addon.core.measure.accuracy import Errors
from addon.lab.commands import growth as command
from addon.lab.growth import growth
from addon.lab.growth import report as growth_report
from addon.lab.growth.growth import Options, Point
from addon.lab.report import plots

QUICK = ["--triangles", "500,1000,2000", "--repeats", "1", "--size", "32", "--check-rays", "256", "--no-peak"]
KD = [*QUICK, "--structures", "kd"]


class LyingNative:
    """As the real module, but `kd` lies."""

    def __init__(self, lie: str) -> None:
        self._lie = lie

    def __getattr__(self, name: str) -> Any:
        return getattr(halfspace_native, name)

    def build(self, vertices: Any, triangles: Any, spec: str, **options: Any) -> Any:
        found = halfspace_native.build(vertices, triangles, spec, **options)
        return Lying(found, self._lie) if spec == "kd" else found


@pytest.fixture(autouse=True)
def _without_plots(monkeypatch: pytest.MonkeyPatch) -> None:
    """They take longer than all else, and have a test of their own."""
    monkeypatch.setattr(plots, "problem", lambda: "left out here")


def document(folder: Path) -> Any:
    return json.loads((folder / "growth.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("count", [500, 10_000, 31_623])
def test_the_surface_is_closed_and_has_about_the_size_asked_for(count: int) -> None:
    made = growth.torus(count)
    assert abs(len(made.triangles) / count - 1) < 0.05
    edges = np.concatenate([made.triangles[:, [0, 1]], made.triangles[:, [1, 2]], made.triangles[:, [2, 0]]])
    # Each edge once in each direction, and as many corners as a torus has.
    there = np.unique(edges, axis=0)
    assert len(there) == len(edges)
    assert np.array_equal(there, np.unique(edges[:, ::-1], axis=0))
    assert len(made.vertices) - len(edges) // 2 + len(made.triangles) == 0
    assert growth.torus(count).fingerprint() == made.fingerprint()


def test_the_rays_are_the_same_for_all_sizes_and_meet_every_tessellation() -> None:
    sets = growth.fixed_rays(halfspace_native, Options(size=(32, 32)))
    assert [some.name for some in sets] == ["primary", growth.ALONE, "diffuse"]
    assert [some.order for some in sets] == ["tile8", "none", "none"]
    for count in (5_000, 40_000):
        made = growth.torus(count)
        structure = halfspace_native.build(made.vertices, made.triangles, "kd")
        found = [structure.closest(some.origins, some.directions).triangle >= 0 for some in sets]
        assert all(hit.all() for hit in found), count


def test_what_grows_as_n_log_n_and_log_n_is_fitted_without_a_rest() -> None:
    counts = [10_000, 100_000, 1_000_000]
    built = growth.fit_build(counts, [3e-9 * n * np.log2(n) for n in counts])
    assert built is not None
    assert built.power == pytest.approx(built.ideal)
    assert built.constant == pytest.approx(3.0)
    assert built.ratios == pytest.approx([1, 1, 1])
    square = growth.fit_build(counts, [1e-9 * n**2 for n in counts])
    assert square is not None
    assert square.power == pytest.approx(2)
    assert max(square.ratios) > 5
    traced = growth.fit_trace(counts, [20 + 7 * np.log2(n) for n in counts])
    assert traced is not None
    assert (traced.base, traced.slope) == pytest.approx((20, 7))
    assert traced.ratios == pytest.approx([1, 1, 1])
    bent = growth.fit_trace(counts, [1.0, 2.0, 9.0])
    assert bent is not None
    assert bent.ratios == pytest.approx([1.25, 0.5, 1.25])
    assert growth.fit_build([1000], [1.0]) is None
    assert growth.fit_trace([1000, 2000], [1.0, 2.0]) is None


def test_it_writes_both_files_with_every_number_beside_its_errors(tmp_path: Path, capsys: Any) -> None:
    out = tmp_path / "deep" / "out"
    assert command.main([*QUICK, "--structures", "kd,bsp-wn-plus-kd", "--out", str(out)]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["growth.html", "growth.json"]
    found = document(out)
    assert [(row["spec"], row["triangles"]) for row in found["rows"]] == [
        (spec, len(growth.torus(count).triangles)) for count in (500, 1000, 2000) for spec in ("kd", "bsp-wn-plus-kd")
    ]
    for row in found["rows"]:
        assert row["errors"]["rays"] == 3 * 256
        assert row["errors"]["false_miss"] == row["errors"]["wrong_values"] == row["errors"]["t_ulp_max"] == 0
        assert sorted(row["builds"]) == ["1", "2"]
        assert len(row["builds"]["2"]["wall"]) == 1
        assert row["speed_up"] > 0
        assert all(one["nanoseconds"] > 0 and one["steps"] > 0 for one in row["rays"].values())
        # A tile tests a triangle once for all its rays.
        assert row["rays"]["primary"]["tests"] < row["rays"][growth.ALONE]["tests"]
    assert set(found["fits"]) == {"kd", "bsp-wn-plus-kd"}
    assert len(found["fits"]["kd"]["build"]["ratios"]) == 3
    assert found["fits"]["kd"]["rays"]["diffuse"]["steps"]["slope"] > 0
    said = capsys.readouterr().out
    assert "kd: the build grows as n^" in said
    assert "kd: 2 threads build × " in said
    page = (out / "growth.html").read_text(encoding="utf-8")
    assert "grows as n^" in page
    assert "Plots are left out" in page
    assert "%" not in [line.strip() for line in page.splitlines()]


def test_sizes_that_are_one_tessellation_tell_no_growth() -> None:
    assert len(growth.torus(500).triangles) == len(growth.torus(501).triangles)
    assert growth.fit_build([504, 504], [1.0, 2.0]) is None
    assert growth.fit_trace([504, 504, 1000], [1.0, 2.0, 3.0]) is None
    assert growth.fit_build([504, 504, 1000], [1.0, 1.0, 2.0]) is not None


def test_the_table_counts_a_wrong_ray_once() -> None:
    lost = Errors(rays=9, false_miss=1, wrong_any_hit=1, wrong=1)
    point = Point("kd", 500, errors=lost)
    assert growth_report.cells(point, [point])[-2:] == ["9", "1"]


@pytest.mark.parametrize("lie", LIES)
def test_where_an_answer_is_wrong_no_time_is_told(
    lie: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setattr(native, "load", lambda: LyingNative(lie))
    wanted = [*KD, "--triangles", "500", "--out", str(tmp_path)]
    assert command.main(wanted) == 1
    (row,) = document(tmp_path)["rows"]
    assert not row["builds"]
    assert not row["rays"]
    assert row["speed_up"] is None
    assert 'class="wrong"' in (tmp_path / "growth.html").read_text(encoding="utf-8")
    assert "the build grows" not in capsys.readouterr().out


def test_the_memory_of_a_build_is_told(tmp_path: Path) -> None:
    wanted = [part for part in KD if part != "--no-peak"]
    assert command.main([*wanted, "--triangles", "20000", "--threads", "1", "--out", str(tmp_path)]) == 0
    (row,) = document(tmp_path)["rows"]
    assert row["bytes"] < row["peak_bytes"] < 100 * row["bytes"]
    assert row["left_out"] == []
    assert row["speed_up"] is None


def test_a_tree_that_rays_build_is_no_point(tmp_path: Path) -> None:
    with pytest.raises(growth.LazyError, match="kd:lazy=1 is built lazily"):
        list(growth.measure(halfspace_native, ["kd:lazy=1"], Options(sizes=(500,), size=(32, 32))))


def test_a_build_that_fails_leaves_the_others(tmp_path: Path, capsys: Any) -> None:
    assert command.main([*KD, "--memory-limit", "0.0005", "--out", str(tmp_path)]) == 2
    rows = document(tmp_path)["rows"]
    assert rows[-1]["error"]
    assert rows[0]["error"] is None
    assert "triangles:" in capsys.readouterr().err


def test_the_plots_show_every_structure() -> None:
    points = []
    for spec, scale in (("kd", 1.0), ("bih", 0.1)):
        for n in (10_000, 100_000, 1_000_000):
            seconds = scale * 1e-7 * n * np.log2(n)
            rays = {"diffuse": {"nanoseconds": 30 * np.log2(n), "steps": 3 * np.log2(n), "tests": 4.0}}
            builds = {1: {"processor": [seconds], "wall": [seconds]}}
            points.append(Point(spec, n, errors=None, builds=builds, rays=rays))
    build, rays_drawn = growth_report.figures(points)
    assert "kd: n^1.08" in build.svg
    assert "bih: n^1.08" in build.svg
    assert "steps per ray" in rays_drawn.svg


def test_what_failed_first_hides_nothing_of_what_did_not() -> None:
    both = {"diffuse": {"nanoseconds": 30.0, "steps": 3.0}, "primary": {"nanoseconds": 20.0, "steps": 2.0}}
    right = Errors(rays=9)
    points = [Point("kd", 500, error="there is no room"), Point("kd", 4000, errors=right, error="no room later")]
    # Its rays were traced in part, and then its builds had no room.
    points[1].rays["diffuse"] = both["diffuse"]
    for spec in ("bih", "kd"):
        for n in (1000, 2000):
            builds = {threads: {"processor": [1e-6 * n], "wall": [1e-6 * n / threads]} for threads in (1, 2)}
            rays = both if spec == "bih" else {}
            points.append(Point(spec, n, errors=right, builds=builds, rays=rays))
    assert growth_report.cells(points[1], points)[-2:] == ["9", "no room later"]
    assert "kd: 2 threads build × 2.00 at 1,000, 2.00 at 2,000" in growth_report.findings(points)
    _, drawn = growth_report.figures(points)
    assert "steps per ray" in drawn.svg


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--structures", "octopus"], "unknown structure 'octopus'"),
        (["--structures", "kd:max_depth=999"], "max_depth"),
        (["--structures", "kd,kd:lazy=1"], "--structures: kd:lazy=1 is built lazily"),
        (["--triangles", "many"], "expected a number"),
        (["--triangles", "10"], "--triangles: expected 400 to"),
        (["--triangles", "1e12"], "--triangles: expected 400 to"),
        (["--triangles", "nan"], "--triangles: expected 400 to"),
        (["--size", "100"], "a multiple of 8"),
        (["--threads", "0"], "--threads: expected 1 to"),
        (["--repeats", "0"], "--repeats: expected 1 to"),
        (["--check-rays", "0"], "--check-rays: expected 1 to"),
        (["--ray-seed", "-1"], "--ray-seed: expected 0 to"),
        (["--memory-limit", "-1"], "gigabytes"),
        (["--wrong"], "unrecognized arguments"),
    ],
)
def test_bad_usage_is_one_line_and_status_2(tmp_path: Path, capsys: Any, arguments: list[str], message: str) -> None:
    out = tmp_path / "out"
    assert command.main([*KD, *arguments, "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
    assert not out.exists(), "nothing is written before everything is known to be right"


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "file").write_text("in the way")
    assert command.main([*KD, "--out", str(tmp_path / "file" / "inside")]) == 2
    assert "cannot be written" in capsys.readouterr().err
