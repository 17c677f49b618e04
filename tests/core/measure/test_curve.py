# SPDX-License-Identifier: GPL-3.0-or-later
"""Error against run time: the measures, and that more samples bring less error in the same picture."""

from __future__ import annotations

from dataclasses import replace

import halfspace_native
import numpy as np
import pytest

from addon.core.measure import benchmark, curve, flip, picture_times
from addon.core.measure.benchmark import Options
from addon.core.scene import grid


def test_rmse_and_relmse_follow_their_definitions() -> None:
    reference = np.full((1000, 3), 2.0, np.float32)
    picture = reference + np.float32(0.5)
    found = curve.errors(picture, reference)
    assert found["rmse"] == pytest.approx(0.5)
    assert found["relmse"] == pytest.approx(0.25 / 4.01)
    assert found["not_finite"] == 0


def test_one_firefly_in_a_thousand_does_not_decide_relmse_but_rmse() -> None:
    reference = np.ones((1000, 3), np.float32)
    picture = reference.copy()
    picture[7] = 1000.0
    found = curve.errors(picture, reference)
    assert found["relmse"] == 0.0
    assert found["rmse"] > 30.0


def test_pixels_that_are_not_finite_are_counted_and_nothing_else() -> None:
    reference = np.ones((4, 3), np.float32)
    picture = reference.copy()
    picture[0, 1], picture[2, 0] = np.nan, np.inf
    assert curve.errors(picture, reference) == {"rmse": 0.0, "relmse": 0.0, "not_finite": 2}


def test_error_falls_with_samples_and_is_the_same_for_every_structure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(curve, "SIZE", 32)
    options = Options(size=(64, 64), repeats=1, check_rays=64, curve=(1, 16))
    small = grid.workload(boxes=2, rays=64)
    outside = curve.View(np.array([-3.0, -4.0, 4.0]), np.ones(3), np.array([0.0, 0.0, 1.0]), 40.0)
    workload = type(small)(small.name, small.vertices, small.triangles, outside)
    rows = list(benchmark.measure(halfspace_native, workload, ["kd", "kd-sah"], options, lambda _: None))
    first, second = ([point["rmse"] for point in row["curve"]] for row in rows)
    assert first == second
    assert [row["errors"]["differing_pixels"] for row in rows] == [0, 0]
    assert [point["spp"] for point in rows[0]["independent"]] == [1, 16]
    assert rows[0]["independent"] == rows[1]["independent"]
    # Sixteen times the samples give a quarter of the noise, or less where the samples are well spread.
    assert 0.0 < first[1] / first[0] < 0.35
    assert all(row["render_s"] == row["curve"][-1]["seconds"] for row in rows)


def test_the_time_of_a_picture_is_of_interleaved_rounds_beside_the_same_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(curve, "SIZE", 16)
    monkeypatch.setattr(benchmark, "GROUP", 1)
    options = Options(size=(16, 16), repeats=3, check_rays=64, curve=(1, 2))
    small = grid.workload(boxes=2, rays=64)
    order: list[str] = []
    events = benchmark.events(halfspace_native, small, ["kd", "kd-sah", "bih"], options)
    rows = {}
    for event in events:
        if isinstance(event, benchmark.Finished):
            rows[event.row["spec"]] = event.row
        elif "timing a picture" in event.text:
            order.append(event.text.partition(":")[0])
    assert order[:4] == ["kd", "kd-sah", "kd", "kd-sah"]
    assert len({row["round_id"] for row in rows.values()}) == 2
    for row in rows.values():
        times = row["image"]
        assert (times["anchor"], len(times["rounds_s"]), len(times["anchor_rounds_s"])) == ("kd", 3, 3)
        assert times["noise"] >= 0
        # Of the picture that is timed, with as many rays in more pixels.
        assert (times["samples"], times["pixels"]) == (1, 23 * 23)
        assert row["image_s"] == {
            "min": min(times["rounds_s"]),
            "med": sorted(times["rounds_s"])[1],
            "max": max(times["rounds_s"]),
        }
        assert times["rounds_s"][0] > 0


def test_a_picture_is_timed_in_many_pixels_rather_than_with_many_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rays as far apart as in few pixels do not go together as they do in the picture that is told of."""
    small, asked = grid.workload(2, 64), []
    made = halfspace_native.render

    class Heard:
        def __getattr__(self, name: str) -> object:
            return getattr(halfspace_native, name)

        def render(self, scene: object, camera: object, settings: dict[str, int], *, threads: int) -> object:
            asked.append(tuple(settings[key] for key in ("width", "height", "samples")))
            return made(scene, camera, settings, threads=threads)

    monkeypatch.setattr(curve, "SIZE", 16)
    pictures = curve.Curve(Heard(), small, (64, 32), (1, 16), 1)
    tree = halfspace_native.build(small.vertices, small.triangles, "kd")
    seconds, differing = pictures.timed(tree, 16, 1)
    assert asked == [(128, 64, 1)]
    assert (seconds > 0, differing) == (True, 0)
    # Never more pixels than the picture that is told of has.
    assert pictures.finer(1 << 20) == (round(32 * 2048**0.5), round(16 * 2048**0.5), 512)


def test_a_picture_that_takes_long_is_timed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(curve, "SIZE", 8)
    monkeypatch.setattr(picture_times, "LONGEST", 0)
    options = Options(size=(8, 8), repeats=3, check_rays=64, curve=(1,), pass_seconds=0.0)
    (row,) = benchmark.measure(halfspace_native, grid.workload(2, 64), ["kd"], options, lambda _: None)
    assert row["image"] is None
    assert row["image_s"]["min"] == row["image_s"]["max"] > 0


def test_independent_samples_converge_with_the_root() -> None:
    outside = curve.View(np.array([-3.0, -4.0, 4.0]), np.ones(3), np.array([0.0, 0.0, 1.0]), 40.0)
    small = grid.workload(boxes=2, rays=64)
    pictures = curve.Curve(halfspace_native, replace(small, view=outside), (64, 64), (1, 2, 4, 8, 16, 32), 1)
    pictures.converge(halfspace_native.build(small.vertices, small.triangles, "kd"))
    assert curve.slope(pictures.independent) == pytest.approx(-0.5, abs=0.05)


def test_a_few_bright_pixels_do_not_tilt_the_line_and_a_wrong_reference_does() -> None:
    rng = np.random.default_rng(3)
    pictures = list(rng.normal(1.0, 0.1, (64, 300, 3)).astype(np.float32))
    pictures[9][5] = 4000.0
    counts = (1, 2, 4, 8, 16)
    reference = np.ones((300, 3), np.float32)
    right = curve.slope(list(curve.of_independent(pictures, reference, counts)))
    assert right == pytest.approx(-0.5, abs=0.01)
    pictures[9][5] = 1.0
    wrong = curve.slope(list(curve.of_independent(pictures, reference * np.float32(1.1), counts)))
    assert curve.judged(right).endswith("holds")
    assert not curve.is_right(wrong)
    assert curve.judged(wrong).endswith("does not hold")


def test_the_slope_is_that_of_the_logarithms() -> None:
    points = [{"spp": float(n), "rmse": 3.0 * n**-0.5} for n in (1, 4, 16)]
    assert curve.slope(points) == pytest.approx(-0.5)


@pytest.mark.skipif(flip.problem() is not None, reason=str(flip.problem()))
def test_flip_is_zero_for_equal_and_one_for_opposite_pictures() -> None:
    green, blue = (np.zeros((32, 32, 3), np.float32) for _ in range(2))
    green[..., 1], blue[..., 2] = 1.0, 1.0
    assert flip.mean(green, green) == 0.0
    # No two colours are farther apart; white beyond white is white, and what is no number is black.
    assert flip.mean(green, blue) == pytest.approx(1.0, abs=1e-3)
    assert flip.mean(np.full_like(green, 5.0), np.ones_like(green)) == 0.0
    assert flip.mean(np.full_like(green, np.nan), np.zeros_like(green)) == 0.0


def test_what_would_take_too_long_is_left_out_and_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(curve, "SIZE", 8)
    monkeypatch.setattr(curve, "POINT_SECONDS", 0.0)
    options = Options(size=(8, 8), repeats=1, check_rays=64, curve=(1,))
    (row,) = benchmark.measure(halfspace_native, grid.workload(2, 64), ["kd"], options, lambda _: None)
    assert row["curve"] is None
    assert any("take too long" in reason for reason in row["too_slow"])


def test_a_picture_that_differs_is_an_error() -> None:
    row = {"errors": {"reference": "brute", "differing_pixels": 1}}
    keys = ("false_miss", "false_hit", "wrong_triangle", "wrong_any_hit", "wrong_values", "t_ulp_max")
    row["errors"] |= dict.fromkeys(keys, 0)
    assert not benchmark.agrees(row)
    row["errors"]["differing_pixels"] = 0
    assert benchmark.agrees(row)
