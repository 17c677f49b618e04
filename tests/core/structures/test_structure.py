# SPDX-License-Identifier: GPL-3.0-or-later
"""The native module as Python sees it: arrays in, arrays out, and what bad arguments get."""

from __future__ import annotations

import re
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

from addon.core.scene import workload
from addon.lab.stability import leaks
from tests.kinds import KINDS
from tests.rooms_of_triangles import soup

SCENES = Path(__file__).resolve().parents[4] / "shared" / "scenes"
VERTICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
TRIANGLES = np.array([[0, 1, 2], [0, 1, 3]], np.int32)
DOWN = np.array([[0.25, 0.25, 1.0]], np.float32), np.array([[0.0, 0.0, -2.0]], np.float32)


def random_rays(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Rays through the unit cube."""
    random = np.random.default_rng(seed)
    origins = random.random((count, 3)) * 3 - 1
    return origins.astype(np.float32), (random.random((count, 3)) - origins).astype(np.float32)


def test_a_hit_is_where_it_should_be() -> None:
    hits = native.build(VERTICES, TRIANGLES).closest(*DOWN)
    assert (hits.t.tolist(), hits.triangle.tolist(), hits.u.tolist(), hits.v.tolist()) == ([0.5], [0], [0.25], [0.25])
    assert [column.dtype for column in (hits.t, hits.triangle, hits.u, hits.v)] == [
        np.dtype(name) for name in ("f4", "i4", "f4", "f4")
    ]
    assert len(hits) == 1
    assert hits.counters is None
    assert hits.on_boundary is None


def test_a_miss_is_infinite_and_minus_one() -> None:
    hits = native.build(VERTICES, TRIANGLES).closest(DOWN[0], -DOWN[1])
    assert (hits.t.tolist(), hits.triangle.tolist()) == ([np.inf], [-1])


def test_any_layout_of_the_arrays_gives_the_same_answer() -> None:
    vertices, triangles = soup(200, 0)
    origins, directions = random_rays(500)
    expected = native.build(vertices, triangles).closest(origins, directions)
    wide = np.zeros((500, 6), np.float32)
    wide[:, ::2] = origins
    for change in (np.float64, np.asfortranarray, lambda a: a[::-1][::-1]):
        tree = native.build(change(vertices), triangles.astype(np.int64))
        hits = tree.closest(wide[:, ::2], change(directions))
        np.testing.assert_array_equal(hits.t, expected.t)
        np.testing.assert_array_equal(hits.triangle, expected.triangle)
    unsigned = native.build(vertices, triangles.astype(np.uint32)).closest(origins, directions)
    np.testing.assert_array_equal(unsigned.triangle, expected.triangle)


@pytest.mark.parametrize("spec", KINDS)
def test_threads_and_counting_change_nothing(spec: str) -> None:
    vertices, triangles = soup(300, 0)
    rays = random_rays(10_000)
    tree = native.build(vertices, triangles, spec)
    one, many = tree.closest(*rays, threads=1), tree.closest(*rays, threads=3, counters=True)
    for name in ("t", "triangle", "u", "v"):
        np.testing.assert_array_equal(getattr(one, name), getattr(many, name))
    counters = many.counters
    np.testing.assert_array_equal(
        counters["steps"], sum(counters[f"steps_{kind}"] for kind in ("axis", "oblique", "boxes"))
    )
    nodes = counters["steps"] + counters["leaves"] + counters["leaves_empty"]
    assert counters["visits"].sum() >= nodes.sum()
    assert (counters["tests_wasted"] <= counters["tests"]).all()
    assert (counters["tests"] >= counters["verdicts"]).all()
    occluded, counted = tree.occluded(*rays, counters=True)
    np.testing.assert_array_equal(occluded, one.triangle >= 0)
    assert counted["steps"].shape == (10_000,)


@pytest.mark.parametrize("robust", ["widen", "none"])
def test_ta_b_counts_its_cases(robust: str) -> None:
    tree = native.build(*soup(300, 0), f"kd:traversal=ta-b,robust={robust}")
    found = tree.closest(*random_rays(10_000), counters=True).counters
    cases = {name: count for name, count in found.items() if name.startswith("case_")}
    assert len(cases) == 13
    np.testing.assert_array_equal(sum(cases.values()), found["steps"])
    # Rays in all directions from around the scene: every case but those of origins in planes and of rays along them.
    often = {name for name, count in cases.items() if count.any()}
    assert often == {f"case_{side}{number}" for side in "np" for number in (1, 3, 4, 5)}
    # Straight up from below everything: no plane of x and y is ever approached.
    up = np.array([[0.5, 0.5, -9]], np.float32), np.array([[0, 0, 1]], np.float32)
    found = tree.closest(*up, counters=True).counters
    assert found["case_n2"] + found["case_p2"] > 0
    assert {name for name, count in found.items() if name.startswith("case_") and count.any()} <= {
        *("case_n2", "case_p2", "case_n3", "case_n4", "case_n5"),
    }
    other = native.build(*soup(300, 0), f"kd:traversal=dir,robust={robust}")
    assert "case_n1" not in other.closest(*up, counters=True).counters


def test_the_interval_may_differ_from_ray_to_ray() -> None:
    tree = native.build(VERTICES, TRIANGLES)
    origins, directions = (np.repeat(a, 4, axis=0) for a in DOWN)
    hits = tree.closest(origins, directions, np.array([0, 0.5, 0.6, 0]), np.array([np.inf, 0.5, 9, 0.4]))
    assert hits.triangle.tolist() == [0, 0, -1, -1]


@pytest.mark.parametrize("spec", ["kd", "bvh-sah", "kd:nodes=wide", "bsp-wn:k=3", "bsp-wn:k=3,nodes=wide"])
def test_many_rays_in_random_order_answer_as_few(spec: str) -> None:
    vertices, triangles = leaks.icosphere(6)
    rng = np.random.default_rng(3)
    n = 1 << 16
    origins = rng.uniform(-1.2, 1.2, (n, 3)).astype(np.float32)
    directions = rng.normal(size=(n, 3)).astype(np.float32)
    limits = rng.uniform(0, 0.2, n).astype(np.float32), rng.uniform(0.3, 3, n).astype(np.float32)
    tree = native.build(vertices.astype(np.float32), triangles, spec)
    assert tree.statistics["bytes"] > 1 << 22, "smaller ones are walked in the order of the rays"
    for ends in limits, (0.0, np.inf):
        everything, occluded = (ask(origins, directions, *ends) for ask in (tree.closest, tree.occluded))
        assert 0 < occluded.sum() < n
        assert np.array_equal(occluded, everything.triangle >= 0)
        for part in np.split(np.arange(n), 4):
            own = [end[part] if isinstance(end, np.ndarray) else end for end in ends]
            few = tree.closest(origins[part], directions[part], *own)
            for name in ("t", "triangle", "u", "v"):
                assert np.array_equal(getattr(everything, name)[part], getattr(few, name)), name


def test_triangles_that_cannot_be_hit_are_dropped_and_the_rest_keep_their_numbers() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [np.nan, 0, 0], [2, 0, 0]], np.float32)
    tree = native.build(vertices, np.array([[0, 1, 3], [0, 1, 4], [0, 1, 2]]))
    assert tree.statistics["dropped_triangles"] == 2
    assert tree.closest(*DOWN).triangle.tolist() == [2]


@pytest.mark.parametrize("spec", KINDS)
def test_nothing_is_a_scene_too(spec: str) -> None:
    tree = native.build(VERTICES[:0], TRIANGLES[:0], spec)
    assert tree.closest(*DOWN).triangle.tolist() == [-1]
    assert tree.closest(DOWN[0][:0], DOWN[1][:0]).t.shape == (0,)
    assert tree.validate() == []
    assert np.isfinite(tree.statistics["sah_cost"])
    assert len(tree.split_polygons()["kind"]) == 0


def test_planes_through_edges_of_the_teapot_part_their_cells() -> None:
    # Planes of triangles run through corners of cells that other such planes made, and that rounding moved.
    file = SCENES / "utah-teapot-plane.npz"
    if not file.exists():
        pytest.skip(f"{file} is not there")
    scene = workload.load_npz(file)
    assert native.build(scene.vertices, scene.triangles, "bsp-ize").validate() == []


@pytest.mark.parametrize("spec", ["kd", "bih", "bih5", "bih1", "bih4", "bih-n"])
def test_split_polygons_lie_in_their_planes_and_in_the_scene(spec: str) -> None:
    vertices, triangles = soup(400, 0)
    tree = native.build(vertices, triangles, spec)
    polygons = tree.split_polygons(max_depth=6, max_count=40)
    assert polygons["vertices"].shape == (polygons["offsets"][-1], 3)
    everything = tree.split_polygons(max_depth=6)
    assert len(polygons["kind"]) == 40
    assert len(polygons["kind"]) + polygons["hidden"] == len(everything["kind"])
    used = vertices[triangles]
    low, high = used.min((0, 1)), used.max((0, 1))
    for i, kind in enumerate(polygons["kind"]):
        corners = polygons["vertices"][polygons["offsets"][i] : polygons["offsets"][i + 1]]
        flat = np.ptp(corners, axis=0) == 0
        assert flat[kind] if spec == "kd" else kind == 4 and flat.any()
        assert (corners >= low).all()
        assert (corners <= high).all()
        if spec != "kd":
            # Planes of an interval hierarchy are coordinates of triangles.
            axis = int(np.argmax(flat))
            assert (used[..., axis] == corners[0, axis]).any()
    assert (np.diff(polygons["depth"].astype(int)) >= 0).all(), "breadth first"


@pytest.mark.parametrize(
    ("error", "message", "change"),
    [
        ("ShapeError", r"vertices: expected an \(n, 3\) .* of shape \(4, 2\)", {"vertices": VERTICES[:, :2]}),
        ("ShapeError", "vertices: .* got list", {"vertices": VERTICES.tolist()}),
        ("ShapeError", r"triangles\[1\]: index 4 is out of range for 4", {"triangles": [[0, 1, 2], [0, 1, 4]]}),
        ("ShapeError", r"triangles\[0\]: index -1 is out of range", {"triangles": [[-1, 1, 2]]}),
        ("ShapeError", "triangles: .* got float64 array", {"triangles": [[0.0, 1.0, 2.0]]}),
        ("SpecError", "unknown structure 'oak'", {"spec": "oak"}),
        ("SpecError", "'kd' has no key 'k'", {"spec": "kd:k=3"}),
        ("SpecError", "threads: expected a whole number from 0 to 1024, got 5000", {"threads": 5000}),
    ],
)  # fmt: skip
def test_a_build_rejects_bad_arguments_by_name(error: str, message: str, change: dict[str, Any]) -> None:
    arguments = {"vertices": VERTICES, "triangles": TRIANGLES, "spec": "kd"} | change
    if isinstance(change.get("triangles"), list):
        arguments["triangles"] = np.array(change["triangles"])
    with pytest.raises(getattr(native, error), match=message):
        native.build(**arguments)


@pytest.mark.parametrize("number", [-1, 10**30, -(10**5000)], ids=["negative", "large", "endless"])
@pytest.mark.parametrize(
    ("argument", "ask"),
    [
        ("threads", lambda n: native.build(VERTICES, TRIANGLES, threads=n)),
        ("memory_limit", lambda n: native.build(VERTICES, TRIANGLES, memory_limit=n)),
        ("max_depth", lambda n: native.build(VERTICES, TRIANGLES).split_polygons(n)),
        ("max_count", lambda n: native.build(VERTICES, TRIANGLES).split_polygons(max_count=n)),
        ("min_triangles", lambda n: native.build(VERTICES, TRIANGLES).leaf_cells(n)),
        ("max_count", lambda n: native.build(VERTICES, TRIANGLES).leaf_cells(max_count=n)),
        ("seed", lambda n: native.cases(seed=n)),
    ],
)
def test_whole_numbers_out_of_range_name_their_argument(
    argument: str, ask: Callable[[Any], object], number: int
) -> None:
    got = number if abs(number) < 10**40 else "one of more than 40 digits"
    with pytest.raises(native.SpecError) as caught:
        ask(number)
    assert re.fullmatch(f"{argument}: expected a whole number from 0 to [0-9]+, got {got}", str(caught.value))
    with pytest.raises(TypeError, match=argument):
        ask("many")


@pytest.mark.parametrize("method", ["closest", "occluded"])
@pytest.mark.parametrize(
    ("error", "message", "arguments"),
    [
        ("ShapeError", "directions: expected one per origin, 1, got 2", (DOWN[0], np.ones((2, 3), np.float32))),
        ("NonFiniteError", r"directions\[0\]: .*NaN.* is not finite", (DOWN[0], np.array([[0, np.nan, 1]]))),
        ("NonFiniteError", r"origins\[0\]: .*inf.* is not finite", (np.array([[0, np.inf, 1]]), DOWN[1])),
        ("NonFiniteError", "t_min: NaN is no distance", (*DOWN, np.nan)),
        ("NonFiniteError", r"t_max\[0\]: NaN is no distance", (*DOWN, 0, np.array([np.nan]))),
        ("ShapeError", "t_max: expected a number or 1 of them", (*DOWN, 0, np.zeros(2))),
    ],
)
def test_rejects_bad_rays_by_name(method: str, error: str, message: str, arguments: tuple[Any, ...]) -> None:
    ask = getattr(native.build(VERTICES, TRIANGLES), method)
    with pytest.raises(getattr(native, error), match=message):
        ask(*arguments)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("method", ["closest", "occluded"])
def test_rejects_the_first_bad_ray_of_many(method: str, threads: int) -> None:
    # More than one thread takes at once, in random order over a tree beyond the caches, where they are sorted.
    tree = native.build(*soup(40_000, 0))
    rng = np.random.default_rng(2)
    origins, directions = rng.uniform(-1, 1, (2, 60_000, 3)).astype(np.float32)
    ask = getattr(tree, method)
    ask(origins, directions, threads=threads)
    directions[20_000, 1] = np.inf
    with pytest.raises(native.NonFiniteError, match=r"directions\[20000\]: .*inf.* is not finite"):
        ask(origins, directions, threads=threads)
    origins[[59_999, 50_000], 2] = np.nan
    with pytest.raises(native.NonFiniteError, match=r"origins\[50000\]: .*NaN.* is not finite"):
        ask(origins, directions, threads=threads)


@pytest.mark.parametrize("spec", ["kd", "kd:traversal=tile", "bvh-sah:traversal=tile16", "bvh-sah:traversal=packet"])
def test_a_tile_that_looks_away_remembers_nothing_of_the_one_before(spec: str) -> None:
    tree = native.build(*soup(400, 0), spec)
    rng = np.random.default_rng(4)
    towards, away = np.float32([0, 0, 1]), np.float32([0, 0, -1])
    aims = np.repeat(np.stack([towards, away] * 4), 256, axis=0)
    directions = (aims + 0.2 * rng.uniform(-1, 1, aims.shape)).astype(np.float32)
    origins = np.broadcast_to(np.float32([0.5, 0.5, -3]), directions.shape)
    hits = tree.closest(origins, directions, order="tile8", threads=1)
    alone = native.build(*soup(400, 0), "brute").closest(origins, directions)
    assert (hits.triangle >= 0).any()
    assert (hits.triangle[aims[:, 2] < 0] == -1).all()
    assert np.array_equal(hits.triangle, alone.triangle)
    assert np.array_equal(hits.t, alone.t)


def test_tiles_have_64_rays() -> None:
    tree = native.build(VERTICES, TRIANGLES)
    with pytest.raises(native.ShapeError, match="a multiple of 64 rays, got 1"):
        tree.closest(*DOWN, order="tile8")
    with pytest.raises(native.SpecError, match="order: expected none or tile8, got spiral"):
        tree.closest(*DOWN, order="spiral")


def test_errors_are_what_python_programmers_catch() -> None:
    for name in ("ShapeError", "NonFiniteError", "SpecError"):
        assert issubclass(getattr(native, name), ValueError)
    assert issubclass(native.Cancelled, RuntimeError)


@pytest.mark.parametrize(
    "spec", ["kd", "kd:lazy=1", "kd:traversal=dir", "bsp-wn:nodes=boxes,traversal=ordered", "bvh-sah"]
)
def test_progress_ends_at_one(spec: str) -> None:
    monitor = native.Monitor()
    native.build(*soup(1000, 0), spec, monitor=monitor)
    assert monitor.progress == pytest.approx(1, abs=1e-6)


def exact(vertices: np.ndarray, triangles: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> tuple[Any, int]:
    """The nearest hit in rational arithmetic, written for reading: the third opinion."""
    o, d = ([Fraction(float(x)) for x in p] for p in (origin, direction))

    def minus(a: list[Fraction], b: list[Fraction]) -> list[Fraction]:
        return [x - y for x, y in zip(a, b, strict=True)]

    def det(a: list[Fraction], b: list[Fraction], c: list[Fraction]) -> Fraction:
        return (
            a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
        )

    best: tuple[Any, int] = (None, -1)
    for number, triangle in enumerate(triangles):
        a, b, c = ([Fraction(float(x)) for x in vertices[i]] for i in triangle)
        e, f, s = minus(b, a), minus(c, a), minus(o, a)
        area = det(e, f, d)
        if area == 0:
            continue
        # Cramer's rule for o + t d = a + u (b - a) + v (c - a)
        u, v, t = det(s, f, d) / area, det(e, s, d) / area, -det(e, f, s) / area
        if u >= 0 and v >= 0 and u + v <= 1 and t >= 0 and (best[0] is None or t < best[0]):
            best = (t, number)
    return best


@pytest.mark.parametrize("seed", range(3))
def test_exact_arithmetic_agrees_with_rational_arithmetic(seed: int) -> None:
    random = np.random.default_rng(seed)
    # Coordinates of few bits, so that rays often meet edges, corners and planes exactly.
    vertices = (random.integers(-4, 5, (30, 3)) / 2).astype(np.float32)
    triangles = random.integers(0, 30, (25, 3)).astype(np.int32)
    origins = (random.integers(-8, 9, (150, 3)) / 2).astype(np.float32)
    directions = random.integers(-2, 3, (150, 3)).astype(np.float32)
    hits = native.exact_closest(vertices, triangles, origins, directions)
    brute = native.build(vertices, triangles, "brute").closest(origins, directions)
    np.testing.assert_array_equal(hits.t, brute.t)
    np.testing.assert_array_equal(hits.triangle, brute.triangle)
    found = 0
    for i in range(150):
        t, triangle = exact(vertices, triangles, origins[i], directions[i])
        assert hits.triangle[i] == triangle
        if t is not None:
            # Correct rounding: no other float32 is nearer.
            got = Fraction(float(hits.t[i]))
            error = abs(got - t)
            for other in (np.nextafter(hits.t[i], np.float32(-1)), np.nextafter(hits.t[i], np.float32(np.inf))):
                assert error <= abs(Fraction(float(other)) - t)
            found += 1
    assert found > 5
    assert hits.on_boundary.any()


def test_ulps_are_counted_through_zero() -> None:
    tiny = np.float32(1e-45)
    a = np.array([1, 0, tiny, np.nan, np.inf], np.float32)
    b = np.array([np.nextafter(np.float32(1), np.float32(2)), -0.0, -tiny, np.nan, 3.4028235e38], np.float32)
    assert native.ulp_distance(a, b).tolist() == [1, 0, 2, 0, 1]
    with pytest.raises(native.ShapeError, match="b: expected 5 numbers, got 1"):
        native.ulp_distance(a, b[:1])


def test_recorded_walks_are_replayed() -> None:
    tree = native.build(*soup(300, 0), "kd:traversal=dir")
    rays = random_rays(3000)
    recording = tree.record(*rays)
    assert len(recording) == 3000
    seconds = recording.replay()
    assert seconds.shape == (3,), "1024 rays at a time"
    assert (seconds > 0).all()
    counters = tree.closest(*rays, counters=True).counters
    for name, count in recording.counters.items():
        np.testing.assert_array_equal(count, counters[name])
    _, shadows = tree.occluded(*rays, counters=True)
    np.testing.assert_array_equal(tree.record(*rays, any_hit=True).counters["steps"], shadows["steps"])
    with pytest.raises(native.SpecError, match="brute"):
        native.build(*soup(3, 0), "brute").record(*rays)
