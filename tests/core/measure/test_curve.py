# SPDX-License-Identifier: GPL-3.0-or-later
"""Error against run time: the measures, and that more samples bring less error in the same picture."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import halfspace_native
import numpy as np
import pytest

from addon.core.measure import benchmark, curve, flip, picture_times
from addon.core.measure.benchmark import Options
from addon.core.scene import grid
from addon.core.scene.workload import Workload
from tests.lying_native import altered


@pytest.fixture(autouse=True)
def _small_portrait(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(curve, "PORTRAIT", 16)


def grey(value: float, count: int = 1000) -> Any:
    """A picture of one value, (count, 3)."""
    return np.full((count, 3), value, np.float32)


def test_errors_follow_their_definitions_and_leave_no_pixel_out() -> None:
    found = curve.errors(grey(2.5), grey(2.0))
    assert found == {"rmse": pytest.approx(0.5), "relmse": pytest.approx(0.25 / 4.01), "not_finite": 0}
    bright = grey(1.0)
    bright[7] = 1000.0
    found = curve.errors(bright, grey(1.0))
    assert found["relmse"] == pytest.approx(999.0**2 / 1.01 / 1000)
    assert found["rmse"] == pytest.approx(999.0 / 1000**0.5)
    # Pixels that are not finite are counted and black.
    broken = grey(1.0, 4)
    broken[0, 1], broken[2, 0] = np.nan, np.inf
    expected = {"rmse": pytest.approx(0.5**0.5), "relmse": pytest.approx(0.5 / 1.01), "not_finite": 2}
    assert curve.errors(broken, grey(1.0, 4)) == expected


def mirror(angle: float) -> tuple[Any, dict[str, Any]]:
    """A wavy mirror below a small sun, whose reflections are rare and thousands of times as bright as white."""
    side = 24
    x, y = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side), indexing="ij")
    z = 0.04 * np.sin(9 * x) * np.cos(7 * y)
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    quads = corner[:, None] + np.array([0, side, 1, 1, side, side + 1])
    scene = {
        "materials": [{"name": "Mirror", "base_color": (0.9, 0.9, 0.9), "metallic": 1.0, "roughness": 0.05}],
        "lights": [{"kind": "sun", "to_world": np.eye(4), "power": (3.0, 3.0, 3.0), "angle": angle}],
        "world": {"color": (0.3, 0.4, 0.5)},
    }
    view = curve.View(np.array([0.3, -0.4, 3.0]), np.zeros(3), np.array([0.0, 1.0, 0.0]), 40.0)
    return Workload("mirror", vertices, quads.reshape(-1, 3).astype(np.int32), view), scene


def test_the_limits_let_pictures_of_a_mirrored_sun_converge_and_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    workload, scene = mirror(angle=0.02)
    monkeypatch.setattr(curve, "plain_scene", lambda: scene)
    monkeypatch.setattr(curve, "SIZE", 32)
    tree = halfspace_native.build(workload.vertices, workload.triangles, "kd")
    pictures = curve.Curve(halfspace_native, workload, (32, 32), (1, 4, 16), 1)
    pictures.converge(tree)
    assert pictures.converged is not None
    facts = pictures.converged
    assert (facts["samples"], facts["limits"]) == (64, curve.LIMITS)
    assert 0.0 < facts["rmse"] < pictures.independent[-1]["rmse"]
    assert 0.0 < facts["removed"] < 1.0
    assert curve.is_right(curve.slope(pictures.independent))
    # Without the limits, a few samples decide the error.
    monkeypatch.setattr(curve, "LIMITS", {"clamp_direct": 0.0, "clamp_indirect": 0.0})
    free = curve.Curve(halfspace_native, workload, (32, 32), (1, 4, 16), 1)
    free.converge(tree)
    assert free.independent[0]["rmse"] > 2 * pictures.independent[0]["rmse"]
    assert free.converged is not None
    assert free.converged["removed"] == 0.0


def test_another_renderer_is_compared_with_the_same_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(curve, "SIZE", 8)
    small = grid.workload(boxes=2, rays=64)
    asked: list[Any] = []

    class Grey:
        name = "grey"

        def render(self, size: tuple[int, int], samples: int, *rest: Any) -> tuple[Any, float]:
            asked.append((size, samples, *rest))
            return np.full((size[1], size[0], 3), 0.5 + 0.1 * 2**0.5 * (len(asked) % 2), np.float32), 2.0

    options = Options(size=(16, 8), repeats=1, check_rays=64, curve=(1, 2))
    (row,) = benchmark.measure(halfspace_native, replace(small, peer=Grey()), ["kd"], options, lambda _: None)
    assert [(one[0], one[1]) for one in asked] == [((16, 8), 1)] * 2 + [((16, 8), 2)] * 2
    assert asked[0][-2:] == (curve.LIMITS, 1)
    assert [(point["spp"], point["seconds"]) for point in row["peer"]] == [(1, 2.0), (2, 2.0)]
    # Its error is that about its own mean, and the difference of the means stands apart.
    assert [point["rmse"] for point in row["peer"]] == [pytest.approx(0.1), pytest.approx(0.1)]
    assert row["converged"]["peer"] > 0.1
    assert row["portrait"].startswith("iVBORw0KGgo")


def outside() -> Workload:
    """The grid of boxes, seen from outside."""
    view = curve.View(np.array([-3.0, -4.0, 4.0]), np.ones(3), np.array([0.0, 0.0, 1.0]), 40.0)
    return replace(grid.workload(boxes=2, rays=64), view=view)


def test_error_falls_with_samples_and_is_the_same_for_every_structure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(curve, "SIZE", 32)
    options = Options(size=(64, 64), repeats=1, check_rays=64, curve=(1, 16))
    rows = list(benchmark.measure(halfspace_native, outside(), ["kd", "kd-sah"], options, lambda _: None))
    first, second = ([point["rmse"] for point in row["curve"]] for row in rows)
    assert first == second
    assert [row["errors"]["differing_pixels"] for row in rows] == [0, 0]
    assert [point["spp"] for point in rows[0]["independent"]] == [1, 16]
    assert rows[0]["independent"] == rows[1]["independent"]
    # Sixteen times the samples give a quarter of the noise, or less where the samples are well spread.
    assert 0.0 < first[1] / first[0] < 0.35
    assert all(row["render_s"] == row["curve"][-1]["seconds"] for row in rows)


def test_the_time_of_a_picture_is_of_interleaved_rounds_with_the_same_anchor(monkeypatch: pytest.MonkeyPatch) -> None:
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
        assert row["image_s"] == dict(zip(("min", "med", "max"), sorted(times["rounds_s"]), strict=True))
        assert times["rounds_s"][0] > 0


def test_a_picture_is_timed_in_many_pixels_rather_than_with_many_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rays as far apart as in few pixels do not go together as they do in the picture that is told of."""
    small, asked = grid.workload(2, 64), []

    def render(scene: Any, camera: Any, settings: dict[str, int], *, threads: int) -> object:
        asked.append(tuple(settings[key] for key in ("width", "height", "samples")))
        return halfspace_native.render(scene, camera, settings, threads=threads)

    monkeypatch.setattr(curve, "SIZE", 16)
    pictures = curve.Curve(altered(render=render), small, (64, 32), (1, 16), 1)
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


def test_independent_samples_converge_with_the_root(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(curve, "SIZE", 64)
    scene = outside()
    pictures = curve.Curve(halfspace_native, scene, (64, 64), (1, 2, 4, 8, 16, 32), 1)
    pictures.converge(halfspace_native.build(scene.vertices, scene.triangles, "kd"))
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


def test_errors_are_expectations_without_the_noise_of_the_reference() -> None:
    rng = np.random.default_rng(6)
    halves = [rng.normal(1.0, 0.2, (40_000, 3)).astype(np.float32) for _ in range(2)]
    pictures = [rng.normal(1.0, 0.1, (40_000, 3)).astype(np.float32) for _ in range(4)]
    found = curve.expected([curve.squared_errors(one, halves[0], halves[1]) for one in pictures])
    assert found["rmse"] == pytest.approx(0.1, rel=0.02)
    assert 0.095 < found["rmse_95"][0] < found["rmse"] < found["rmse_95"][1] < 0.105
    # Against their mean, as usual, half of its own noise would be in it.
    mean = np.mean(halves, axis=0, dtype=np.float64).astype(np.float32)
    assert curve.errors(pictures[0], mean)["rmse"] == pytest.approx((0.1**2 + 0.2**2 / 2) ** 0.5, rel=0.02)


def test_pictures_that_do_not_fit_into_the_time_are_left_out() -> None:
    # Four pictures of each count and four times the samples of the largest.
    assert curve.fitting((1, 2, 4, 8), 1.0, 44.0) == (1, 2, 4)
    assert curve.fitting((1, 2, 4, 8), 1.0, 43.0) == (1, 2)
    assert curve.fitting((4, 8), 1.0, 0.1) == (4,)


def test_the_slope_is_that_of_the_logarithms() -> None:
    points = [{"spp": float(n), "rmse": 3.0 * n**-0.5} for n in (1, 4, 16)]
    assert curve.slope(points) == pytest.approx(-0.5)
    # One picture has none, nor has a picture without noise.
    assert math.isnan(curve.slope([{"spp": 1, "rmse": 0.0}, {"spp": 4, "rmse": 0.0}]))
    assert math.isnan(curve.slope([{"spp": 1, "rmse": 1.0}]))


@pytest.mark.skipif(flip.problem() is not None, reason=str(flip.problem()))
def test_flip_is_zero_for_equal_and_one_for_opposite_pictures() -> None:
    green, blue = (np.zeros((32, 32, 3), np.float32) for _ in range(2))
    green[..., 1], blue[..., 2] = 1.0, 1.0
    assert flip.mean(green, green) == 0.0
    # No two colours are farther apart; white beyond white is white, and what is no number is black.
    assert flip.mean(green, blue) == pytest.approx(1.0, abs=1e-3)
    assert flip.mean(np.full_like(green, 5.0), np.ones_like(green)) == 0.0
    assert flip.mean(np.full_like(green, np.nan), np.zeros_like(green)) == 0.0


def test_pictures_that_would_take_too_long_are_left_out_and_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(curve, "SIZE", 8)
    monkeypatch.setattr(curve, "POINT_SECONDS", 0.0)
    options = Options(size=(8, 8), repeats=1, check_rays=64, curve=(1,))
    (row,) = benchmark.measure(halfspace_native, grid.workload(2, 64), ["kd"], options, lambda _: None)
    assert row["curve"] is None
    assert any("take too long" in reason for reason in row["too_slow"])


def test_a_picture_that_differs_is_an_error() -> None:
    keys = ("false_miss", "false_hit", "wrong_triangle", "wrong_any_hit", "wrong_values", "t_ulp_max")
    errors = {"reference": "brute", "differing_pixels": 1, **dict.fromkeys(keys, 0)}
    row = {"spec": "kd", "errors": errors}
    assert not benchmark.agrees(row)
    errors["differing_pixels"] = 0
    assert benchmark.agrees(row)
