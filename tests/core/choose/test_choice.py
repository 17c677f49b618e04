# SPDX-License-Identifier: GPL-3.0-or-later
"""Choosing a structure: the arithmetic of build plus render, and what is tried and what is not."""

from __future__ import annotations

import dataclasses
import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from addon.core.base.background import Background
from addon.core.choose import auto, choice
from addon.core.choose.choice import Comparison, Line, Mix, Plan
from addon.core.measure import benchmark, check
from addon.core.scene.workload import View, Workload
from addon.core.structures import catalogue, specs, ways
from addon.lab.commands import choose
from tests import rooms_of_triangles
from tests.lying_native import LIES, Lying, LyingNative, altered

native = pytest.importorskip("halfspace_native")


@pytest.fixture
def soup() -> Workload:
    triangles = rooms_of_triangles.soup(600, 5, box=[4, 3, 2], size=0.2)
    view = View(np.array([2.0, -6.0, 3.0]), np.array([2.0, 1.5, 1.0]), np.array([0.0, 0.0, 1.0]), 40.0)
    return Workload("soup", *triangles, view)


def chosen_of(module: Any, soup: Workload, tried: list[str], plan: Plan | None = None) -> Any:
    """The choice among these configurations."""
    chooser = auto.Chooser(module, soup, plan or Plan(1 << 20, 64), tried, 1)
    for _ in chooser.steps():
        pass
    assert chooser.result is not None
    return chooser.result


def test_a_picture_takes_its_rays_at_their_speeds() -> None:
    counted = Mix(primary=1.0, shadow=2.0, secondary=3.0)
    plan = Plan(pixels=1_000_000, samples=10)
    assert counted.seconds({"primary": 10, "shadow": 5, "diffuse": 2}, plan) == pytest.approx(10 * (0.1 + 0.4 + 1.5))
    assert counted.seconds({"primary": 10}, plan) == pytest.approx(6.0)


def test_few_samples_want_a_quick_build_and_many_a_quick_walk() -> None:
    def compared(samples: int) -> Comparison:
        lines = (Line("bvh-sah", 0.1, 2.0 * samples), Line("kd", 5.0, 1.0 * samples), Line("x", problem="broken"))
        return Comparison(Plan(100, samples), tuple(sorted(lines, key=lambda line: (bool(line.problem), line.total))))

    few, many = compared(1), compared(100)
    assert (few.best.spec, few.fastest.spec) == ("bvh-sah", "kd")
    assert (many.best.spec, many.fastest.spec) == ("kd", "kd")
    quick, dear = "bvh-sah: 0.10 s to build and 2.00 s to trace", "kd: 5.00 s to build and 1.00 s to trace"
    assert few.reason() == quick.replace(":", " finishes 100 pixels of 1 sample first:") + f". Then {dear}."
    assert many.reason().startswith(
        "kd finishes 100 pixels of 100 samples first: 5.00 s to build and 100.00 s to trace"
    )
    assert [line.spec for line in few.sound] == ["bvh-sah", "kd"]


def test_the_answer_has_three_lines() -> None:
    quick, both = Line("bvh-sah", 0.1, 6.0), Line("kd", 0.05, 1.0)
    slow, close = Line("kd", 5.0, 1.0, least=0.5), Line("bih", 0.2, 5.0, least=5.0, most=7.0)
    wrong = Line("brute", problem="3 of 10 answers are wrong")
    times = "0.10 s to build and 6.00 s to trace"
    for lines, expected in (
        ((quick,), ("BVH-SAH.", f"{times}.", "No other could have saved time.")),
        ((quick, wrong), ("BVH-SAH.", f"{times}.", "Nothing else gave right answers.")),
        ((both, quick), ("KD.", "0.05 s to build and 1.00 s to trace; BVH-SAH takes 481% longer.", "Its build is the")),
        ((slow, dataclasses.replace(quick, trace=9.0)), ("KD.", "5.00 s to build and 1.00 s to", "Its rays are the")),
        (
            (dataclasses.replace(quick, trace=3.0), slow),
            ("BVH-SAH.", "0.10 s to build and 3.00", "Its build is the sho"),
        ),
        (
            (close, Line("grid", 0.1, 9.0), slow),
            ("BIH.", "0.20 s to build", "Others have faster rays or a shorter build"),
        ),
    ):
        answer = Comparison(Plan(100, 1), lines).answer(str.upper)
        assert all(line.startswith(start) for line, start in zip(answer, expected, strict=True)), answer
    assert Comparison(Plan(100, 1), (close, slow)).answer(str.upper)[-1].endswith("Not certain: repeats overlap.")
    assert Comparison(Plan(100, 1), (wrong,)).answer(str.upper) == ("No configuration gives right answers.",)


def test_configurations_that_the_repeats_do_not_separate_are_equal() -> None:
    plan = Plan(100, 1)
    best, close = Line("kd", 1.0, 2.0, least=2.0, most=2.4), Line("bvh-sah", 0.5, 2.8, least=2.8, most=3.5)
    far = Line("grid", 1.0, 3.0, least=3.0, most=3.2)
    found = Comparison(plan, (best, close, far))
    assert found.best is best
    assert found.equal == (close,)
    assert found.reason().endswith("its repeats took 3.00 to 3.40 s, and those of bvh-sah overlap them.")
    assert "not certain" not in Comparison(plan, (best, far)).reason()
    # Wrong answers are no rivals, however fast.
    wrong = Line("brute", 0.0, 1.0, 3, 10, "3 of 10 answers are wrong")
    assert Comparison(plan, (best, far, wrong)).equal == ()
    # Many equal ones are three names and a number.
    lines = [Line(f"s{n}", 1.0, 2.0 + n / 100, least=2.0, most=2.5) for n in range(9)]
    assert "those of s1, s2, s3 and 5 more overlap them" in Comparison(Plan(100, 1), tuple(lines)).reason()


def test_two_comparisons_agree_or_leave_the_best_open() -> None:
    plan = Plan(100, 1)
    kd, bvh = Line("kd", 1.0, 2.0, least=2.0, most=2.1), Line("bvh-sah", 1.0, 3.0, least=3.0, most=3.1)
    one = Comparison(plan, (kd, bvh))
    assert one.beside(Comparison(plan, (kd,)), "Choose for Me") == "Choose for Me found the same."
    # Each separates them, in opposite orders.
    turned = Comparison(plan, (dataclasses.replace(bvh, trace=1.5, least=1.5, most=1.6), kd))
    contradiction = "Compare found bvh-sah: the two measurements contradict each other, so neither is certain."
    assert one.beside(turned, "Compare") == contradiction
    assert "neither is certain" in turned.beside(one, "Choose for Me")
    # The repeats of one overlap.
    close = Comparison(plan, (dataclasses.replace(bvh, trace=1.5, least=1.5, most=2.5), kd))
    for a, b in ((one, close), (close, one)):
        assert a.beside(b, "Compare").endswith("the repeats do not tell which of the two is better.")
    elsewhere = Comparison(plan, (Line("grid", 1.0, 1.0),))
    assert one.beside(elsewhere, "Compare") == "Compare found grid, which was not measured here."
    # Another picture has another answer.
    assert one.beside(Comparison(Plan(100, 2), (bvh,)), "Compare") == ""
    assert one.beside(Comparison(plan, (Line("x", problem="broken"),)), "Compare") == ""


def test_choosing_and_comparing_agree_on_the_same_speeds(soup: Workload) -> None:
    options = benchmark.Options(size=(32, 32), sets=choice.SETS, repeats=3, check_rays=64)
    chosen = ["kd:traversal=dir", "octree-net"]
    rows = list(benchmark.measure(native, soup, chosen, options, lambda _text: None))
    counted, plan = Mix(1.0, 0.5, 0.5), Plan(1000, 4)
    compared = choice.compare(rows, counted, plan)
    for row, line in ((row, next(one for one in compared.lines if one.spec == row["spec"])) for row in rows):
        speeds = {name: row["rays"][name]["rounds"] for name in choice.SETS}
        assert (line.least, line.most) == pytest.approx(counted.bounds(speeds, plan, 1))
        assert line.least <= line.trace <= line.most
    # The automatic choice takes the quickest pass, the comparison the median: each names the other as best or equal.
    quickest = [dataclasses.replace(line, trace=line.least) for line in compared.lines]
    chosen_of = Comparison(plan, tuple(sorted(quickest, key=lambda line: line.total)))
    for one, other in ((compared, chosen_of), (chosen_of, compared)):
        assert other.best.spec in {one.best.spec, *(line.spec for line in one.equal)}


def test_of_each_tree_its_best_way_is_compared_and_what_was_asked_for() -> None:
    chosen = ["kd:nodes=boxes", "bvh-sah", "kd", "kd:traversal=dir"]
    found = Comparison(Plan(100, 1), tuple(Line(spec, 1.0, float(n)) for n, spec in enumerate(chosen)))
    assert [line.spec for line in found.of_trees().lines] == ["kd:nodes=boxes", "bvh-sah"]
    kept = found.of_trees("kd:traversal=dir")
    assert [line.spec for line in kept.lines] == ["kd:nodes=boxes", "bvh-sah", "kd:traversal=dir"]


def test_the_best_of_each_family_is_tried() -> None:
    tried = auto.candidates(catalogue.load())
    assert {"bvh-sah", "bvh-hlbvh"} <= set(tried)
    for spec in tried:
        structure = catalogue.load()[spec.partition(":")[0]]
        assert "fastest" in ways.tables(structure, specs.canonical(native, spec)), spec


def test_one_alone_is_not_called_the_fastest() -> None:
    alone, wrong = Line("kd", 1.0, 2.0, 0, 10), Line("grid", 1.0, 1.0, 3, 10, "3 of 10 answers are wrong")
    times = "kd: 1.00 s to build and 2.00 s to trace for 100 pixels of 1 sample; nothing else"
    assert Comparison(Plan(100, 1), (alone,)).reason() == f"{times} was tried over the whole scene."
    assert Comparison(Plan(100, 1), (alone, wrong)).reason() == f"{times} gave right answers."


def test_rows_become_lines_and_wrong_answers_are_never_best(soup: Workload) -> None:
    options = benchmark.Options(size=(32, 32), sets=choice.SETS, repeats=2, check_rays=64)
    rows = list(benchmark.measure(native, soup, ["kd", "bvh-sah"], options, lambda _text: None))
    tree = native.build(soup.vertices, soup.triangles, "kd")
    counted = choice.mix(native, tree, soup, (32, 32), 4)
    assert counted.primary == pytest.approx(1.0)
    assert counted.shadow > 0
    found = choice.compare(rows, counted, Plan(1000, 4))
    assert {line.spec for line in found.sound} == {"kd", "bvh-sah"}
    assert all(line.build > 0 and line.trace > 0 and line.checked > 0 for line in found.sound)
    assert found.best is found.lines[0]
    rows[0]["errors"]["false_miss"] = 1
    found = choice.compare(rows, counted, Plan(1000, 4))
    assert len(found.sound) == 1
    assert "wrong" in found.lines[-1].problem


def test_choosing_gives_a_built_structure_and_says_why(soup: Workload) -> None:
    known = catalogue.load()
    chosen = auto.choose(native, soup, Plan(1 << 20, 64), known, threads=1)
    assert chosen.spec in auto.candidates(known)
    assert chosen.structure.statistics["references"] > 0
    assert chosen.structure.spec.partition(":")[0] == chosen.spec.partition(":")[0]
    assert chosen.spec == min(chosen.comparison.lines, key=lambda line: line.total).spec
    assert 0 < chosen.own <= chosen.seconds
    assert chosen.spec in chosen.notes[0]
    assert any("Choosing took" in note for note in chosen.notes)
    # Every candidate was tried in full, or a note has the reason.
    told = {spec for note in chosen.notes for spec in note.split(": ")[0].split(", ")}
    assert set(auto.candidates(known)) <= told | {line.spec for line in chosen.comparison.lines}


def test_a_candidate_that_the_catalogue_lacks_is_named_with_the_reason(soup: Workload) -> None:
    whole = catalogue.load()
    assert auto.dropped(whole) == []
    known = catalogue.Catalogue(tuple(one for one in whole.structures if one.id in ("bvh-sah", "kd")))
    quickest = [spec for one in known.structures for spec in ways.fastest(one, one.id)]
    assert sorted(auto.candidates(known)) == sorted(quickest)
    left = auto.dropped(known)
    assert len(left) == len(auto.TREES) - 2
    assert left[0] == "bvh-hlbvh: left out, unknown structure 'bvh-hlbvh'; there are kd, bvh-sah"
    assert set(left) <= set(auto.choose(native, soup, Plan(1 << 20, 64), known, threads=1).notes)


def test_every_full_trial_is_compared_with_brute_force_which_is_asked_once(soup: Workload) -> None:
    built: list[str] = []

    def build(vertices: Any, triangles: Any, spec: str, **options: Any) -> Any:
        built.append(spec)
        return native.build(vertices, triangles, spec, **options)

    chosen = auto.choose(altered(build=build), soup, Plan(1 << 20, 64), catalogue.load(), threads=1)
    assert built.count("brute") == 1
    assert len(chosen.comparison.lines) > 1
    for line in chosen.comparison.lines:
        assert line.wrong == 0
        assert 1000 <= line.checked < 1300
        assert line.answers == f"0 of {line.checked:,} answers wrong"
    assert Line("kd", 1.0, 1.0).answers == "answers not compared"


@pytest.mark.parametrize("lie", LIES)
def test_who_errs_is_not_chosen_however_fast(soup: Workload, monkeypatch: pytest.MonkeyPatch, lie: str) -> None:
    rates(monkeypatch, lambda structure: 100.0 if isinstance(structure, Lying) else 1.0)
    monkeypatch.setattr(auto.choice, "mix", lambda *_: Mix(1.0, 0.0, 0.0))
    for tried in (["bvh-sah", "kd"], ["kd", "bvh-sah"]):
        found = chosen_of(LyingNative(lie), soup, tried)
        assert found.spec == found.structure.spec == "bvh-sah"
        worst = found.comparison.lines[-1]
        assert (worst.spec, worst.total < found.comparison.lines[0].total) == ("kd", True)
        assert 0 < worst.wrong <= worst.checked
        assert worst.problem == f"{worst.wrong} of {worst.checked:,} answers are wrong"
        assert f"kd: left out, {worst.problem}" in found.notes


def test_after_a_wrong_first_no_trial_is_too_long(soup: Workload, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(auto, "SMALL_BUDGET", 0.0)
    monkeypatch.setattr(auto.choice, "mix", lambda *_: Mix(1.0, 0.0, 0.0))
    assert chosen_of(LyingNative("wrong_any_hit"), soup, ["kd", "bvh-sah"]).spec == "bvh-sah"


def test_nothing_is_chosen_when_all_err(soup: Workload, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(auto.choice, "mix", lambda *_: Mix(1.0, 0.0, 0.0))
    words = r"No configuration gives right answers\. kd: \d+ of [\d,]+ answers are wrong"
    with pytest.raises(RuntimeError, match=words):
        chosen_of(LyingNative("false_miss"), soup, ["kd"])


def test_a_tree_that_rays_build_is_charged_all_of_its_build(soup: Workload) -> None:
    options = benchmark.Options(size=(32, 32), sets=choice.SETS, repeats=1, check_rays=64, threads=1)
    rows = list(benchmark.measure(native, soup, ["kd:lazy=1", "kd"], options, lambda _text: None))
    for row in rows:
        upper, first = (0.25, 3.0) if row["spec"] == "kd:lazy=1" else (2.0, 5.0)
        row["build_s"], row["first_s"] = ({"min": s, "med": s, "max": s} for s in (upper, first))
    lines = {line.spec: line for line in choice.compare(rows, Mix(1.0, 0.0, 0.0), Plan(1000, 4)).lines}
    assert {spec: line.build for spec, line in lines.items()} == {"kd:lazy=1": 3.0, "kd": 2.0}


@pytest.mark.parametrize("lie", LIES)
def test_a_row_that_errs_never_says_that_none_is_wrong(soup: Workload, lie: str) -> None:
    options = benchmark.Options(size=(32, 32), sets=choice.SETS, repeats=1, check_rays=64, threads=1)
    rows = list(benchmark.measure(LyingNative(lie), soup, ["kd"], options, lambda _text: None))
    (line,) = choice.compare(rows, Mix(1.0, 0.0, 0.0), Plan(1000, 4)).lines
    assert line.problem
    assert line.wrong > 0
    assert not line.problem.startswith("0 of")


def test_the_command_prints_wrong_answers_with_times(
    soup: Workload, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    camera: dict[str, Any] = {f"camera_{name}": getattr(soup.view, name) for name in ("eye", "target", "up")}
    camera["camera_vfov_deg"] = np.float64(soup.view.vertical_fov)
    np.savez(tmp_path / "soup.npz", vertices=soup.vertices, triangles=soup.triangles, **camera)
    assert choose.main([str(tmp_path / "soup.npz"), "--samples", "4", "--pixels", "100000"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if "trace" in line and "total" in line]
    assert len(lines) == len(auto.candidates(catalogue.load()))
    for line in lines:
        checked = int(line.split(" of ")[1].split()[0].replace(",", ""))
        assert checked >= 192
        assert line.endswith(f"0 of {checked:,} answers wrong")


def test_rays_are_timed_about_as_close_as_those_of_the_picture(soup: Workload, monkeypatch: pytest.MonkeyPatch) -> None:
    """Farther apart they do not go together, and another structure seems the best."""
    assert auto.view_of(1920 * 1080, choose.FINE) == choose.FINE
    assert auto.view_of(1) == (8, 8)
    width, height = auto.view_of(100_000)
    assert 0.9 * 100_000 < width * height <= 100_000
    asked = []

    def heard(structure: Any, some: Any, *arguments: Any) -> list[float]:
        asked.append(len(some))
        return rate(structure, some, *arguments)

    rate = check.rates
    monkeypatch.setattr(check, "rates", heard)

    def most(pixels: int, samples: int) -> int:
        asked.clear()
        chosen_of(native, soup, ["kd"], Plan(pixels, samples))
        return max(asked)

    assert most(1920 * 1080, 32) == 480 * 320
    assert most(64 * 64, 1) <= 64 * 64
    # A picture of few samples is worth fewer of them: timing all would take longer than the picture.
    assert most(480 * 320, 1) == 192 * 128
    assert 192 * 128 < most(1920 * 1080, 2) < 480 * 320


def rates(monkeypatch: pytest.MonkeyPatch, speed: Callable[[Any], float]) -> None:
    """Give structures these speeds, in each pass the same."""
    monkeypatch.setattr(check, "rates", lambda structure, *_: [speed(structure)] * 3)


class Slow:
    """A structure with a given speed and build time."""

    def __init__(self, real: Any, speed: float, build: float) -> None:
        self.real, self.speed = real, speed
        self.statistics = {**real.statistics, "build_seconds": build}

    def __getattr__(self, name: str) -> Any:
        return getattr(self.real, name)


def timed_build(module: Any, scene: Workload, spec: str, *_: Any) -> tuple[Any, float]:
    built = module.build(scene.vertices, scene.triangles, spec, threads=1)
    return built, built.statistics["build_seconds"]


def test_long_pictures_try_dear_structures_and_short_ones_do_not(
    soup: Workload, monkeypatch: pytest.MonkeyPatch
) -> None:
    speeds = {"quick": 1.0, "dear": 4.0, "slow": 0.1}
    builds = {"quick": 1e-4, "dear": 1e-2, "slow": 1e-3}
    built: list[tuple[str, int]] = []

    def build(vertices: Any, triangles: Any, spec: str, **arguments: Any) -> Any:
        if spec == "brute":
            return native.build(vertices, triangles, spec, **arguments)
        built.append((spec, len(triangles)))
        return Slow(native.build(vertices, triangles, "kd"), speeds[spec], builds[spec] * len(triangles))

    rates(monkeypatch, lambda structure: structure.speed)
    monkeypatch.setattr(auto.check, "timed_build", timed_build)
    monkeypatch.setattr(auto.choice, "mix", lambda *_: Mix(1.0, 0.0, 0.0))
    monkeypatch.setattr(auto, "TRIAL_TRIANGLES", 100)
    module = altered(build=build)
    assert chosen_of(module, soup, list(speeds), Plan(1_000_000, 1)).spec == "quick"
    assert ("dear", 600) not in built
    long = chosen_of(module, soup, list(speeds), Plan(1_000_000, 500))
    assert long.spec == "dear"
    assert ("dear", 600) in built
    assert ("slow", 600) not in built
    assert any(note.startswith("slow: left out") for note in long.notes)


def test_few_samples_per_triangle_begin_with_the_quickest_build(
    soup: Workload, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole: list[str] = []

    def build(vertices: Any, triangles: Any, spec: str, **options: Any) -> Any:
        if spec != "brute" and len(triangles) == 600:
            whole.append(spec)
        return Slow(native.build(vertices, triangles, spec, **options), 1.0, 1e-3 * len(triangles))

    rates(monkeypatch, lambda structure: structure.speed)
    monkeypatch.setattr(auto.check, "timed_build", timed_build)
    monkeypatch.setattr(auto.choice, "mix", lambda *_: Mix(1.0, 0.0, 0.0))
    monkeypatch.setattr(auto, "TRIAL_TRIANGLES", 100)
    module, tried = altered(build=build), ["bvh-sah", "bvh-hlbvh", "kd"]
    # The build of the first took most of the time: another one of as many seconds saves nothing.
    short = chosen_of(module, soup, tried, Plan(1024, 1))
    assert (short.spec, whole) == ("bvh-hlbvh", ["bvh-hlbvh"])
    # The reason has both times of the best and of the second.
    assert re.search(r"bvh-hlbvh: 0\.60 s to build and 0\.00 s to trace .* bvh-sah: \S+ s to build and", short.notes[0])
    whole.clear()
    chosen_of(module, soup, tried, Plan(1024, 100))
    assert whole[0] == "bvh-sah"


def test_where_memory_is_short_smaller_structures_come_first(soup: Workload) -> None:
    tried = ["bvh-sah", "kd", "bih-sah"]
    room = ["bih-sah", "brute"]

    def build(vertices: Any, triangles: Any, spec: str, **options: Any) -> Any:
        if options.get("memory_limit") and spec not in room:
            raise MemoryError("memory_limit: the build needs more than the 1 MB it may take")
        return native.build(vertices, triangles, spec, **options)

    chooser = auto.Chooser(altered(build=build), soup, Plan(1 << 20, 64), tried, 1, 1 << 20)
    steps = list(chooser.steps())
    assert [step for step in steps if step.endswith("building")][:2] == ["bvh-sah: building", "bih-sah: building"]
    assert chooser.result is not None
    assert chooser.result.spec == "bih-sah"
    left = [note for note in chooser.result.notes if "memory_limit" in note]
    assert len(left) == 1
    assert left[0].startswith("bvh-sah")
    assert left[0].endswith(": left out, memory_limit: the build needs more than the 1 MB it may take")
    # If none fits, the build's own error remains.
    room.remove("bih-sah")
    with pytest.raises(MemoryError, match="memory_limit"):
        list(auto.Chooser(altered(build=build), soup, Plan(1 << 20, 64), tried, 1, 1 << 20).steps())


def test_work_in_the_background_stops_between_steps_and_hands_on_errors() -> None:
    go, seen = threading.Event(), []

    def steps() -> Any:
        yield 1
        go.wait(300)
        yield 2
        yield 3

    work = Background(steps(), seen.append)
    assert not work.wait(0.05)
    work.stop()
    go.set()
    assert work.wait(300)
    assert seen == [1]

    def broken() -> Any:
        yield 1
        raise ValueError("odd")

    work = Background(broken(), seen.append)
    with pytest.raises(ValueError, match="odd"):
        work.wait(300)
