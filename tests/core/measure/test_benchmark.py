# SPDX-License-Identifier: GPL-3.0-or-later
"""The benchmark checks answers before it times them, and reports structures with wrong ones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import halfspace_native
import numpy as np
import pytest

from addon.core.measure import benchmark, check, costmap, offsets, peak, timing, yardstick
from addon.core.measure.benchmark import Options, Row
from addon.core.report import report
from addon.core.scene import grid, rays, workload
from tests.lying_native import LIES, Lying, LyingNative, altered

QUICK = Options(size=(64, 64), repeats=2, check_rays=512)
SCENES = Path(__file__).resolve().parents[4] / "shared" / "scenes"

KEYS = {
    *("scene", "triangles", "spec", "structure", "k", "alpha", "seed", "threads", "build_s", "first_s", "bytes"),
    *("statistics", "rays", "errors", "curve", "render_s", "left_out"),
}
RAY_KEYS = {"n", "mrays_s", "steps", "tests", "hits"}
ERROR_KEYS = {
    *("reference", "rays", "false_miss", "false_hit", "wrong_triangle", "t_ulp_max", "t_ulp_p999", "on_boundary"),
}

needs_embree = pytest.mark.skipif(yardstick.problem() is not None, reason=str(yardstick.problem()))


def measure(chosen: list[str], options: Options = QUICK, native: Any = halfspace_native) -> dict[str, Row]:
    small = grid.workload(boxes=3, rays=2048)
    return {row["spec"]: row for row in benchmark.measure(native, small, chosen, options, lambda _: None)}


def test_a_row_has_every_key_and_the_expected_numbers_of_rays() -> None:
    row = measure(["kd:traversal=ta-b"])["kd:traversal=ta-b"]
    assert row.keys() >= KEYS
    assert list(row["rays"]) == [*rays.NAMES, "walls"]
    for one in row["rays"].values():
        assert one.keys() >= RAY_KEYS
        assert 0 < one["mrays_s"]["min"] <= one["mrays_s"]["med"] <= one["mrays_s"]["max"]
        assert one["steps"] > 0
        assert sum(one["cases"].values()) == pytest.approx(one["steps"]), "TA-B's cases"
    assert row["errors"].keys() >= ERROR_KEYS
    assert row["rays"]["primary"]["n"] == 64 * 64
    assert row["errors"]["rays"] == 4 * 512 + 2048, "the scene's own rays are all checked"
    few = benchmark.prepared(halfspace_native, grid.workload(boxes=3, rays=2048), replace(QUICK, own_rays=512))
    assert {name: len(some) for name, some in few.checked.items()} == dict.fromkeys((*rays.NAMES, "walls"), 512)
    assert row["errors"]["sets"]["walls"]["on_boundary"] > 100
    assert benchmark.agrees(row)
    assert row["statistics"]["references"] > 0


@pytest.mark.parametrize("lie", LIES)
def test_a_lie_is_seen(lie: str) -> None:
    row = measure(["kd"], native=LyingNative(lie))["kd"]
    assert not benchmark.agrees(row)
    column = "t_ulp_max" if lie == "late" else lie
    assert row["errors"][column] >= 1
    # A false miss leaves `occluded` right, so the two kinds of errors are distinct.
    assert (row["errors"]["wrong_any_hit"] > 0) == (lie == "wrong_any_hit")


@needs_embree
def test_speeds_are_related_to_the_yardstick_round_by_round() -> None:
    rows = measure(["embree", "kd"])
    for name in rays.NAMES:
        ratio = rows["kd"]["rays"][name]["times_embree"]
        ours, base = (np.array(rows[spec]["rays"][name]["rounds"]) for spec in ("kd", "embree"))
        assert ratio == pytest.approx(np.median(ours / base)), "round by round, so that drift cancels"
    assert rows["embree"]["errors"]["sets"]["primary"]["false_miss"] == 0


def test_a_sweep_over_k_is_anchored_at_its_kd_tree() -> None:
    assert benchmark.anchor_of(["embree", "kd-sah", "bsp-wn:k=3", "rbsp:k=13"]) == "embree"
    assert benchmark.anchor_of(["embree", "bsp-wn:k=3", "kd-sah", "bsp-wn:k=13"]) == "kd-sah"
    assert benchmark.anchor_of(["embree", "bsp-wn:k=3", "bsp-wn:k=13"]) == "embree"
    assert benchmark.anchor_of(["bsp-wn:k=3"]) is None


@needs_embree
def test_embree_is_an_ordinary_row_if_it_is_not_the_anchor() -> None:
    rows = measure(["embree", "bsp-wn:k=3", "kd-sah", "bsp-wn:k=4"])
    assert {row["anchor"] for row in rows.values()} == {"kd-sah"}
    assert not any(row["error"] for row in rows.values())
    for name in rays.NAMES:
        assert len(rows["embree"]["rays"][name]["anchor_rounds"]) == len(rows["embree"]["rays"][name]["rounds"])


@needs_embree
def test_embree_hits_the_same_triangles_on_a_scene_without_ties() -> None:
    rng = np.random.default_rng(5)
    corners = rng.normal(size=(300, 1, 3)) + 0.3 * rng.normal(size=(300, 3, 3))
    vertices = corners.reshape(-1, 3).astype(np.float32)
    triangles = np.arange(900, dtype=np.int32).reshape(-1, 3)
    view = workload.framing_view(vertices, triangles)
    soup = workload.Workload("soup", vertices, triangles, view)
    options = Options(size=(64, 64), repeats=1, check_rays=4096, reference="embree")
    (row,) = benchmark.measure(halfspace_native, soup, ["kd"], options, lambda _: None)
    assert row["errors"]["reference"] == "embree"
    assert (row["errors"]["false_miss"], row["errors"]["false_hit"], row["errors"]["wrong_triangle"]) == (0, 0, 0)


def test_exact_arithmetic_agrees() -> None:
    options = Options(size=(16, 16), sets=("primary", "shadow"), repeats=1, check_rays=64, reference="exact")
    small = grid.workload(boxes=2, rays=256)
    (row,) = benchmark.measure(halfspace_native, small, ["kd"], options, lambda _: None)
    assert (row["errors"]["false_miss"], row["errors"]["false_hit"], row["errors"]["wrong_triangle"]) == (0, 0, 0)


def test_first_pictures_are_timed_and_compared_if_a_tree_is_lazy() -> None:
    rows = measure(["kd", "kd:lazy=1"])
    assert all(row["first_s"]["min"] > 0.0 for row in rows.values())
    assert benchmark.agrees(rows["kd:lazy=1"])
    assert rows["kd:lazy=1"]["statistics"]["parts_built"] > 0
    (sentence,) = [text for text in report.findings(list(rows.values())) if text.startswith("Build and camera rays")]
    assert "with kd:lazy=1" in sentence
    assert "with kd; 0 rays differ" in sentence
    assert measure(["kd"])["kd"]["first_s"] is None, "without a lazy tree nothing is timed"

    built = []

    def build(vertices: Any, triangles: Any, spec: str, **options: Any) -> Any:
        """A lazily built tree is wrong from its repeated builds on."""
        structure = halfspace_native.build(vertices, triangles, spec, **options)
        built.append(spec)
        late = spec == "kd:lazy=1" and built.count(spec) > QUICK.repeats
        return Lying(structure, "late") if late else structure

    wrong = measure(["kd", "kd:lazy=1"], native=altered(build=build))["kd:lazy=1"]
    assert wrong["errors"]["differing_pixels"] > 0
    assert not benchmark.agrees(wrong)


@pytest.mark.parametrize("when", ["build", "query"])
def test_a_configuration_that_fails_is_a_row_and_the_others_go_on(when: str) -> None:
    def fail(*_: Any, **__: Any) -> Any:
        raise RuntimeError("too many references\nsecond line")

    def build(vertices: Any, triangles: Any, spec: str, **options: Any) -> Any:
        if spec != "kd-sah":
            return halfspace_native.build(vertices, triangles, spec, **options)
        statistics = {"build_seconds": 0.1, "bytes": 1}
        return fail() if when == "build" else SimpleNamespace(spec=spec, statistics=statistics, closest=fail)

    rows = measure(["kd-sah", "kd"], native=altered(build=build))
    assert rows["kd-sah"]["error"] == "too many references"
    assert rows["kd-sah"]["errors"] is None
    assert not benchmark.agrees(rows["kd-sah"])
    assert benchmark.agrees(rows["kd"])


def test_shadow_rays_are_timed_by_any_hits_and_all_others_by_closest_ones() -> None:
    scene = grid.workload(boxes=2, rays=64)
    tree = halfspace_native.build(scene.vertices, scene.triangles, "kd")
    queries: list[str] = []
    names = ("closest", "occluded")
    recorder: Any = SimpleNamespace(**{name: lambda *_, name=name, **__: queries.append(name) for name in names})
    for some in rays.make(scene, tree, size=(8, 8), seed=1, names=rays.NAMES):
        timing.one_pass(timing.Candidate("kd", recorder), some, 1)
        check.rate(recorder, some, 1)
        # One pass, one to warm up, one timed.
        assert queries == ["occluded" if some.name == "shadow" else "closest"] * 3, some.name
        queries.clear()


class Cached:
    """A structure without answers. By its own clock a pass takes 1 ms, and 2 ms after a pass of another structure."""

    last: ClassVar[Any] = None
    now: ClassVar[float] = 0.0

    def closest(self, *_: Any, **__: Any) -> None:
        Cached.now += 1e-3 if Cached.last is self else 2e-3
        Cached.last = self


def test_short_passes_exclude_cache_misses_after_another_structure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timing, "clock", lambda _: lambda: Cached.now)
    some = rays.RaySet("primary", *(np.zeros(shape, np.float32) for shape in ((64, 3), (64, 3), 64)))
    rate = len(some) / 1e6 / 1e-3
    equal = [timing.Candidate(name, Cached(), checked={"primary": rate}, timed={"primary": some}) for name in "abc"]
    list(timing.rounds(equal, "primary", 6, 1))
    list(timing.scaling(equal, [some], 2, Options(size=(8, 8))))
    for one in equal:
        assert one.seconds["primary"] == pytest.approx([1e-3] * 6)
        assert one.scaling[0]["seconds"] == pytest.approx(1e-3)
    assert timing.noise(equal, "primary") == pytest.approx(0.0)


def test_a_slow_structure_is_timed_on_fewer_rays() -> None:
    row = measure(["kd"], replace(QUICK, pass_seconds=1e-7))["kd"]
    assert row["rays"]["primary"]["n"] == 64
    assert row["errors"]["rays"] == 4 * 512 + 2048


def test_structures_too_large_to_live_together_are_measured_in_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(benchmark, "LIVE_BYTES", 1)
    assert list(measure(["kd", "kd-sah", "kd:traversal=dir"])) == ["kd", "kd-sah", "kd:traversal=dir"]


def test_progress_grows_and_a_closed_iterator_stops_at_once() -> None:
    small = grid.workload(boxes=2, rays=256)
    events = benchmark.events(halfspace_native, small, ["kd", "kd-sah"], QUICK)
    seen = list(events)
    shares = [event.done for event in seen if isinstance(event, benchmark.Progress)]
    assert shares == sorted(shares)
    assert 0 <= shares[0] <= 0.1
    assert 0.9 <= shares[-1] <= 1
    assert [event.row["spec"] for event in seen if isinstance(event, benchmark.Finished)] == ["kd", "kd-sah"]
    events = benchmark.events(halfspace_native, small, ["kd"], QUICK)
    next(events)
    events.close()
    assert list(events) == []


def test_optional_measurements_are_in_the_row() -> None:
    options = replace(QUICK, repeats=1, scaling=True, peak=True, maps=True, offsets=(0.0, 1e3), pass_seconds=5.0)
    rows = measure(["kd", "octree-net"], options)
    assert [point["rays"] for point in rows["kd"]["scaling"]] == [8 * 8, 16 * 16, 32 * 32, 64 * 64]
    assert {(row["map"]["width"], row["map"]["height"]) for row in rows.values()} == {(96, 96)}
    # A build needs at least a byte per reference, and less than a gigabyte for a few hundred triangles.
    assert rows["kd"]["statistics"]["references"] < rows["kd"]["peak_bytes"] < 1e9
    for row in rows.values():
        assert [point["wrong"] for point in row["offsets"]] == [0, 0]
    # Without error bounds the same traversal is wrong on touching boxes; the octree has none without them.
    assert all(point["wrong_unguarded"] > 0 for point in rows["kd"]["offsets"])
    assert rows["octree-net"]["offsets"][0]["wrong_unguarded"] is None
    assert all(row["field"]["tree"]["nodes"] for row in rows.values())
    assert measure(["kd"], replace(QUICK, repeats=1, shapes=False))["kd"]["field"]["tree"] is None


def test_a_cost_map_is_the_work_of_each_pixel_or_of_tiles_traversed_as_a_whole() -> None:
    scene, size = grid.workload(2, 64), (32, 16)
    trees = [halfspace_native.build(scene.vertices, scene.triangles, f"octree-{name}") for name in ("net", "beam")]
    (view,) = rays.make(scene, trees[0], size=size, seed=1, names=("primary",))[:1]
    alone, together = (costmap.work(tree, view, size) for tree in trees)
    counters = trees[0].closest(view.origins, view.directions, counters=True).counters
    expected = counters["steps"] + counters["tests"]
    order = rays.tile_order(*size)
    assert np.array_equal(alone[::-1].reshape(-1)[order], expected.astype(np.float32))
    assert together.sum() < alone.sum()
    for corner in range(0, 32, 8):
        assert np.ptp(together[:8, corner : corner + 8]) == 0
    assert np.array_equal(costmap.unpacked(costmap.packed(alone)), alone)


def test_a_memory_measurement_that_fails_is_noted_and_leaves_the_row(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peak.sys, "executable", "/bin/false")
    row = measure(["kd"], replace(QUICK, repeats=1, peak=True))["kd"]
    assert row["peak_bytes"] is None
    assert row["error"] is None
    assert any(reason.startswith("peak memory: the process that measured it ended") for reason in row["left_out"])


@pytest.mark.parametrize("name", ["killeroo-feet", "sponza-dabrovic"])
def test_real_scenes_agree(name: str) -> None:
    path = SCENES / f"{name}.npz"
    if not path.is_file():
        pytest.skip(f"the scene {name} is not in {SCENES}")
    options = Options(size=(64, 64), repeats=1, check_rays=1024)
    rows = list(benchmark.measure(halfspace_native, workload.load_npz(path), ["kd"], options, lambda _: None))
    assert all(benchmark.agrees(row) for row in rows)


@pytest.mark.parametrize("lie", [lie for lie in LIES if lie != "wrong_any_hit"])
def test_a_wrong_answer_far_from_the_origin_is_counted(lie: str) -> None:
    for native, wrong in ((halfspace_native, 0), (LyingNative(lie, "kd", 0), 1)):
        assert [entry["wrong"] for entry in offsets.Moved(native, (0.0, 1e3), 1).errors("kd")] == [wrong, wrong]


def checked(lie: str) -> check.Check:
    """The complete check of a kd-tree that lies so, or of an honest one."""
    scene = grid.workload(boxes=2, rays=64)
    structure = Lying(halfspace_native.build(scene.vertices, scene.triangles, "kd"), lie)
    *_, found = check.steps(halfspace_native, structure, scene, threads=1)
    return found


def test_a_check_of_an_honest_structure_is_right_and_measures_every_set() -> None:
    found = checked("")
    assert found.right
    assert found.errors.rays >= 64 * 4
    for means in (found.mrays_s, found.steps, found.tests):
        assert tuple(means) == (*check.SETS, "walls")
        assert all(mean > 0 for mean in means.values())


@pytest.mark.parametrize("lie", LIES)
def test_a_check_sees_a_lie(lie: str) -> None:
    found = checked(lie)
    assert not found.right
    # Closest hits and any hits are both compared, and counted apart.
    assert (found.errors.wrong_any_hit > 0) == (lie == "wrong_any_hit")
