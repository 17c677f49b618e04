# SPDX-License-Identifier: GPL-3.0-or-later
"""The stability table: right structures have no differences, wrong ones are noticed, closed surfaces do not leak."""

from __future__ import annotations

import csv
import json
import types
from pathlib import Path
from typing import Any

import halfspace_native
import numpy as np
import pytest

from addon.core.report import results
from addon.core.scene import grid
from addon.core.structures import catalogue, ways
from addon.lab.commands import stability as command
from addon.lab.stability import agreement, leaks, stability, trials
from tests.lying_native import LIES, Lying, LyingNative

LIMIT = 1500


def small_case(name: str) -> dict:
    return next(case for case in halfspace_native.cases() if case["name"] == name)


def test_the_cases_cover_the_list_of_extremes() -> None:
    cases = halfspace_native.cases()
    names = [case["name"] for case in cases]
    assert len(names) == len(set(names))
    covered = {number for case in cases for number in case["extremes"]}
    # Two extremes are not scenes: flushed subnormals and numbers of threads.
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
    kd = catalogue.load()["kd"]
    own = [ways.spelled(kd, "kd", way) for way in kd.ways]
    assert own[0] == "kd"
    assert {"kd:traversal=dir", "kd:nodes=wide", "kd:nodes=boxes,traversal=ordered"} < set(own)
    textbook = ["kd:robust=none", *(f"{spec},robust=none" for spec in own[1:])]
    cached = f"{deep},shadow=cache"
    assert made == [
        *own,
        "kd:shadow=cache",
        "kd:shadow=beam",
        *textbook,
        deep,
        cached,
        f"{deep},shadow=beam",
        f"{deep},robust=none",
        "brute",
        "brute:shadow=cache",
    ]
    narrow = stability.configurations(rows, ["bvh-sah:width=4"])
    assert "bvh-sah:width=4,traversal=ordered" in narrow
    assert not any("flight" in spec for spec in narrow), "values without effect are left out"
    octree = stability.configurations(rows, ["octree-net"])
    assert {"octree-net:shadow=cache", "octree-net:shadow=beam"} < set(octree)


def test_slow_cases_keep_rays_of_all_kinds() -> None:
    for name, most in stability.MOST_RAYS["small"].items():
        case = small_case(name)
        some = stability.fewer_rays(case, most)
        assert len(some["origins"]) == len(some["t_max"]) == most < len(case["origins"])
        assert (some["origins"][[0, -1]] == case["origins"][[0, -1]]).all()
        assert len(np.unique(some["directions"], axis=0)) > most / 2
        assert stability.fewer_rays(case, None)["origins"] is case["origins"]


@pytest.mark.parametrize("lie", LIES)
def test_a_lie_is_noticed(lie: str) -> None:
    case = small_case("random soup")
    honest = list(stability.measure_case(halfspace_native, case, ["kd"], exact_pairs=1000, threads=1))
    lying = list(stability.measure_case(LyingNative(lie), case, ["kd"], exact_pairs=1000, threads=1))
    assert not stability.differs(honest[0])
    assert stability.differs(lying[0])


def test_textbook_traversals_fail_and_ours_do_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(stability.EXACT_PAIRS, "small", 20_000)
    spec = "kd:traversal=dir,shadow=none"
    status = command.main(["--structures", spec, "--leak-rays", "400", "--out", str(tmp_path)])
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
    assert "leaks of kd:traversal=dir" in capsys.readouterr().out


def test_a_wrong_structure_sets_the_status(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stability, "allowed_to_fail", lambda spec: False)
    monkeypatch.setitem(stability.EXACT_PAIRS, "small", 1000)
    assert command.main(["--structures", "kd:robust=none,traversal=dir,shadow=none", "--leak-rays", "0"]) == 1


@pytest.fixture
def holed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A single surface with a hole, in place of the closed surfaces."""
    vertices, triangles = leaks.icosphere(2)
    surface = ("holed", vertices.astype(np.float32), triangles[1:], np.zeros(3), 0.3)
    monkeypatch.setattr(leaks, "surfaces", lambda _: iter([surface]))
    monkeypatch.setattr(command, "BUNNY", Path("none.npz"))


@pytest.mark.usefixtures("holed")
def test_a_leak_sets_the_status(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    rows = trials.trial(halfspace_native, ["kd:shadow=none"], 3, 0)
    monkeypatch.setattr(command, "measure_cases", lambda *_: rows)
    arguments = ["--structures", "kd:shadow=none", "--leak-rays"]
    assert command.main([*arguments, "0"]) == 0
    assert command.main([*arguments, "4000"]) == 1
    assert " 0 leaks" not in capsys.readouterr().out
    assert command.main([*arguments, "4000", "--leaks-only"]) == 1


def test_a_long_run_with_a_difference_sets_the_status(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(trials, "BLOCK", 2)
    arguments = ["--structures", "kd:shadow=none", "--seed", "3", "--long", "1", "--threads", "1"]
    assert command.main(arguments) == 0
    monkeypatch.setattr(command.native, "load", lambda: LyingNative("wrong_triangle", "kd:shadow=none"))
    assert command.main(arguments) == 1
    assert "kd:shadow=none differs in trial 0 of seed 3" in capsys.readouterr().out


class Broken:
    """A structure with right answers, whose `validate` reports a broken node."""

    def __init__(self, structure: Any) -> None:
        self._structure = structure

    def __getattr__(self, name: str) -> Any:
        return getattr(self._structure, name)

    def validate(self) -> list[str]:
        return ["node 3 lies outside of its parent"]


class BrokenNative:
    """The module, whose structures are all Broken."""

    def __getattr__(self, name: str) -> Any:
        return getattr(halfspace_native, name)

    def build(self, *arguments: Any, **options: Any) -> Any:
        return Broken(halfspace_native.build(*arguments, **options))


def test_a_broken_structure_that_answers_well_sets_the_status(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command.native, "load", BrokenNative)
    small = grid.workload(boxes=2, rays=64)
    monkeypatch.setattr(grid, "workload", lambda: small)
    assert command.main(["--structures", "bih:shadow=none", "--rays", "64", "--scenes", "grid"]) == 1
    assert "bih:shadow=none is broken: node 3 lies outside of its parent" in capsys.readouterr().out


@pytest.mark.parametrize("lie", [lie for lie in LIES if lie != "wrong_any_hit"])
def test_the_tree_that_answers_for_brute_force_is_proven_by_it(lie: str) -> None:
    scene = grid.workload(boxes=2, rays=64)
    assert agreement.questions(halfspace_native, scene, 64, 1, threads=1)
    with pytest.raises(agreement.ReferenceDiffersError, match="kd differs from brute force"):
        agreement.questions(LyingNative(lie), scene, 64, 1, threads=1)


def test_whole_scenes_are_compared_and_resumed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vertices, triangles = leaks.icosphere(2)
    scene = tmp_path / "ball.npz"
    view = {"camera_eye": [0, -3, 0], "camera_target": [0, 0, 0], "camera_up": [0, 0, 1], "camera_vfov_deg": 40.0}
    np.savez(scene, vertices=vertices.astype(np.float32), triangles=triangles, **view)
    arguments = [
        "--structures",
        "octree-beam,bih",
        "--rays",
        "300",
        "--out",
        str(tmp_path / "out"),
        "--scenes",
        str(scene),
    ]
    assert command.main(arguments) == 0
    printed = capsys.readouterr().out
    rows = json.loads((tmp_path / "out" / "stability.json").read_text(encoding="utf-8"))["rows"]
    assert {"octree-beam", "octree-beam:shadow=beam", "bih"} < {row["spec"] for row in rows}
    links = {row["spec"]: row["statistics"]["links"] for row in rows}
    for row in rows:
        assert not row["broken"]
        assert row["rays"] > 1000
        assert row["statistics"]["bytes"] > row["statistics"]["nodes_axis"]
    assert links["octree-beam"] > 0
    assert command.main(arguments) == 0
    assert "of them by brute force" in printed
    assert "of them by brute force" not in capsys.readouterr().out
    again = json.loads((tmp_path / "out" / "stability.json").read_text(encoding="utf-8"))["rows"]
    assert [row | {"seconds": 0, "statistics": {}} for row in again] == [
        row | {"seconds": 0, "statistics": {}} for row in rows
    ]


def test_a_scene_answered_wrongly_sets_the_status(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(stability, "allowed_to_fail", lambda spec: False)
    assert command.main(["--structures", "kd:robust=none,shadow=none", "--rays", "2000", "--scenes", "grid"]) == 1
    assert "DIFFERS" in capsys.readouterr().out
    assert command.main(["--scenes", str(tmp_path / "none.npz")]) == 2


def test_a_build_without_room_is_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def crowded(*_: object, **__: object) -> None:
        raise MemoryError("memory_limit: the build needs more than the 1 MB it may take")

    wide = types.SimpleNamespace(build=crowded)
    honest = agreement.row
    monkeypatch.setattr(agreement, "row", lambda _, *rest, **named: honest(wide, *rest, **named))
    assert command.main(["--structures", "kd:shadow=none", "--rays", "100", "--scenes", "grid"]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith("stability: ")
    assert "kd:" in line
    assert "memory_limit" in line


@pytest.mark.parametrize("bad", [["--structures", "tree"], ["--long", "-1"], ["--size", "huge"], ["--long", "x"]])
def test_bad_usage_is_one_line(bad: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(bad) == 2
    assert capsys.readouterr().err.count("\n") == 1


def long_run(folder: Path, *more: str) -> tuple[int, dict]:
    status = command.main(["--structures", "kd,octree-net", "--seed", "3", "--out", str(folder), *more])
    return status, json.loads((folder / "stability.json").read_text(encoding="utf-8"))


def test_a_long_run_is_resumed_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trials, "BLOCK", 4)
    monkeypatch.setattr(trials, "MANY", 256)
    monkeypatch.setattr(trials, "EXACT_PAIRS", 2000)
    status, first = long_run(tmp_path, "--long", "1")
    assert (status, first["options"]["blocks"]) == (0, 1)
    answers = sum(row["rays"] for row in first["rows"])
    assert "no difference in" in first["verdict"]
    assert "fewer than" in first["verdict"]
    made: list[int] = []
    block = trials.block
    monkeypatch.setattr(trials, "block", lambda *a, **k: made.append(a[3]) or block(*a, **k))
    _, second = long_run(tmp_path, "--long", str(2 * answers))
    assert 0 not in made
    assert made
    _, again = long_run(tmp_path / "other", "--long", str(2 * answers))
    assert [row | {"case": ""} for row in again["rows"]] == [row | {"case": ""} for row in second["rows"]]
    # Without time for new blocks, those of the journal count.
    _, third = long_run(tmp_path, "--long", "1e12", "--seconds", "0")
    assert third["rows"] == second["rows"]


@pytest.mark.parametrize("lie", LIES)
def test_a_trial_notices_a_lie(lie: str) -> None:
    rows = [trials.trial(native, ["kd"], 3, 0)[0] for native in (halfspace_native, LyingNative(lie))]
    assert [stability.differs(row) for row in rows] == [False, True]


class Shady:
    """The module with a wrong any-hit answer of the shadow cache: for the first ray, which is also checked exactly."""

    def __getattr__(self, name: str) -> Any:
        return getattr(halfspace_native, name)

    def build(self, vertices: Any, triangles: Any, spec: str, **options: Any) -> Any:
        built = halfspace_native.build(vertices, triangles, spec, **options)
        return Lying(built, "wrong_any_hit") if "shadow=cache" in spec else built


def test_ways_of_shadow_rays_are_compared_with_exact_arithmetic_too() -> None:
    for native, wrong in ((halfspace_native, 0), (Shady(), 1)):
        (row,) = trials.trial(native, ["kd:shadow=cache"], 3, 0)
        assert row["exact_rays"] > 0
        assert (row["wrong_any_hit"], row["exact_wrong"]) == (wrong, wrong)


def test_any_hits_of_extreme_cases_are_compared_with_exact_arithmetic_too() -> None:
    case = small_case("random soup")
    for native, wrong in ((halfspace_native, 0), (Shady(), 1)):
        plain, cache = stability.measure_case(native, case, ["kd", "kd:shadow=cache"], exact_pairs=10_000, threads=1)
        assert cache["exact_rays"] > 0
        assert (cache["wrong_any_hit"], cache["exact_wrong"]) == (wrong, wrong)
        assert plain["exact_wrong"] == 0
    # A ray that differs from both references counts once, not twice.
    both = {name: case[name][:1] for name in ("origins", "directions", "t_min", "t_max")}
    (row,) = stability.measure_case(Shady(), {**case, **both}, ["kd:shadow=cache"], exact_pairs=10_000, threads=1)
    assert (row["exact_rays"], row["exact_wrong"]) == (1, 1)


def test_times_stand_beside_answers_and_slow_rows_are_marked() -> None:
    case = small_case("random soup")
    rows = list(stability.measure_case(halfspace_native, case, ["kd", "brute"], exact_pairs=0, threads=1))
    assert all(row[name] > 0 for row in rows for name in stability.SECONDS)
    head, _, *lines = stability.table(rows).splitlines()
    assert head.endswith("× brute")
    assert len(lines) == 2
    # Ten times as slow as brute force, as slow, and slower by less than two calls take.
    for seconds, marked in (((1.0, 0.1), True), ((0.1, 0.1), False), ((2e-4, 1e-4), False)):
        row = {**rows[0], **dict(zip(stability.SECONDS, seconds, strict=True))}
        assert stability.is_slower(row) == marked
        assert stability.table([row]).endswith("!") == marked
        assert ("<td class=wrong>10.00!</td>" in stability.as_html({"rows": [row], "verdict": ""})) == marked
    assert stability.sums(rows + rows)[0]["trace_seconds"] == 2 * rows[0]["trace_seconds"]
    assert not stability.is_slower(trials.trial(halfspace_native, ["kd"], 3, 0)[0]), "trials have no times"


def test_nearest_hits_are_compared_for_shadow_none_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    nearest = stability.nearest
    calls: list[int] = []
    monkeypatch.setattr(stability, "nearest", lambda *a, **k: calls.append(1) or nearest(*a, **k))
    trials.trial(halfspace_native, ["kd:shadow=none", "kd:shadow=cache"], 3, 0)
    assert calls == [1]


def test_the_bound_counts_each_ray_once_for_all_configurations() -> None:
    vertices, triangles = leaks.icosphere(1)
    rng = np.random.default_rng(1)
    ways = np.repeat(rng.normal(size=(100, 3)).astype(np.float32), 4, axis=0)
    case = {
        "name": "ball",
        "vertices": vertices.astype(np.float32),
        "triangles": triangles.astype(np.int32),
        "origins": np.zeros_like(ways),
        "directions": ways,
        "t_min": np.zeros(400, np.float32),
        "t_max": np.full(400, np.inf, np.float32),
    }
    rows = list(stability.measure_case(halfspace_native, case, ["kd", "bih", "bvh-sah"], exact_pairs=0, threads=1))
    assert [row["rays"] for row in rows] == [400] * 3
    sentence = stability.limit(rows)
    assert "in 1,200 answers of 3 configurations to 100 different rays" in sentence
    assert "fewer than 3.0e-02 of such rays" in sentence
    # The same rays on another scene count again.
    assert "to 200 different rays" in stability.limit([*rows, *rows])


def test_shuffled_bounces_of_a_scene_count_as_no_new_rays() -> None:
    questions = agreement.questions(halfspace_native, grid.workload(boxes=2, rays=64), 64, 1, threads=1)
    fresh = {question.rays.name: question.fresh for question in questions}
    assert fresh["primary"] == fresh["diffuse"] == 64
    assert fresh["shuffled"] == 0


def test_a_report_that_cannot_be_written_leaves_the_old_one(tmp_path: Path, disk_full_at_the_last: Any) -> None:
    rows = trials.trial(halfspace_native, ["kd"], 3, 0)
    document = {**results.document(halfspace_native, rows, {}), "verdict": "old"}
    command.save(tmp_path, document)
    with disk_full_at_the_last(tmp_path), pytest.raises(results.FolderError, match="No space left"):
        command.save(tmp_path, {**document, "verdict": "new"})


def test_trials_cover_all_sorts_and_are_reproducible() -> None:
    names = set()
    for number in range(8 * ((len(trials.SORTS) + 1) // 2)):
        pair = [trials._scene(halfspace_native, 1, number, np.random.default_rng([1, number])) for _ in range(2)]
        assert pair[0][1].tobytes() == pair[1][1].tobytes()
        assert all(a.tobytes() == b.tobytes() for a, b in zip(pair[0][3], pair[1][3], strict=True))
        name, _, triangles, rays = pair[0]
        names.add(name)
        assert triangles.shape[1] == 3
        assert all(np.isfinite(part).all() for part in rays[:2])
        assert len(rays[0]) in (trials.FEWEST, trials.FEW, trials.MANY)
    assert {name for name, _, _ in trials.SORTS} < names


@pytest.mark.parametrize("row", halfspace_native.structures(), ids=lambda row: row["id"])
def test_closed_surfaces_hold(row: dict) -> None:
    for spec in stability.configurations([row], [row["id"]]):
        if not stability.allowed_to_fail(spec):
            assert not leaks.count_leaks(halfspace_native, [spec], list(leaks.surfaces(2)), 2000)[spec], spec


@pytest.mark.parametrize("lie", ["false_miss", "wrong_any_hit"])
def test_leaks_are_found_by_nearest_hits_and_by_any_hits(lie: str) -> None:
    vertices, triangles = leaks.icosphere(1)
    surface = ("sphere", vertices.astype(np.float32), triangles, np.zeros(3), 0.3)
    assert leaks.count_leaks(LyingNative(lie), ["kd"], [surface], 100, threads=1)["kd"]["sphere"] == 1


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
    surface = ("holed", points, triangles[1:], np.zeros(3), 0.3)
    assert leaks.count_leaks(halfspace_native, ["kd"], [surface], 4000)["kd"]["holed"] > 0
    # The fan that closes the hole has the orientation of the rest: each edge occurs once in each direction.
    closed_points, closed = leaks.closed(points, triangles[1:])
    directed = np.concatenate([closed[:, [0, 1]], closed[:, [1, 2]], closed[:, [2, 0]]])
    assert len(closed) == len(triangles) + 2
    assert sorted(map(tuple, directed.tolist())) == sorted(map(tuple, directed[:, ::-1].tolist()))
    surface = ("closed", closed_points, closed, np.zeros(3), 0.3)
    assert not leaks.count_leaks(halfspace_native, ["kd"], [surface], 4000)["kd"]


def test_a_screen_begins_with_what_must_not_be(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stability, "SCREEN", 2)
    rows = trials.trial(halfspace_native, ["kd:shadow=none", "bih:shadow=none", "bvh-sah:shadow=none"], 3, 0)
    rows[2]["false_miss"] = 5
    head, _, first, *_, last = stability.screen(rows).splitlines()
    assert head.split()[:2] == ["case", "structure"]
    assert first.split()[:2] == ["all", rows[2]["spec"]]
    assert last == "and 1 more, 0 of which differ"
    assert stability.screen([]) == ""
