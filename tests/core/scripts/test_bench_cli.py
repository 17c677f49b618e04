# SPDX-License-Identifier: GPL-3.0-or-later
"""The benchmark's command line: what it writes, how it resumes, and one line for whatever is wrong."""

from __future__ import annotations

import csv
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from addon.core.base import native
from addon.core.measure import benchmark, yardstick
from addon.core.report import results
from addon.core.scene import workload
from addon.core.structures import catalogue, specs, ways
from addon.lab.bench import bench_presets, inspecting, ray_files, scenes
from addon.lab.commands import bench
from addon.lab.export import files
from addon.lab.report import history, page, plots
from scripts.dev import environment
from tests.lying_native import LyingNative
from tests.report_rows import everything

BENCH = environment.ROOT / "scripts" / "bench.py"
FAST = ["--size", "32x32", "--repeats", "1", "--check-rays", "128", "--curve", "none", "--only-rays"]
QUICK = [*FAST, "--structures", "kd"]


def saved(path: Path, corners: Any, target: Any = (0.0, 0.0, 0.0), **more: Any) -> Path:
    """A file with the triangles of float[3 n, 3] corners, seen from outside of the origin's neighbourhood."""
    view = {"camera_eye": [0, -5, 1], "camera_target": target, "camera_up": [0, 0, 1], "camera_vfov_deg": 45.0}
    triangles = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    np.savez(path, vertices=np.asarray(corners, np.float32), triangles=triangles, **view, **more)
    return path


def soup(path: Path, **more: Any) -> Path:
    """A file with a hundred triangles around the origin."""
    rng = np.random.default_rng(1)
    corners = rng.normal(size=(100, 1, 3)) + 0.4 * rng.normal(size=(100, 3, 3))
    return saved(path, corners.reshape(-1, 3), **more)


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    return soup(tmp_path / "soup.npz")


@pytest.fixture(autouse=True)
def _without_plots(monkeypatch: pytest.MonkeyPatch) -> None:
    """They take longer than all else, and have tests of their own."""
    monkeypatch.setattr(plots, "problem", lambda: "left out here")


@pytest.fixture(autouse=True)
def _without_an_open_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests of Blender in the same process may have left one open, which would be a scene too."""
    monkeypatch.setattr(scenes, "is_file_open", lambda: False)


def expanded(tree: str) -> list[str]:
    """The configurations of a tree that is only named: one ray at a time, then as fast as it goes."""
    structure = catalogue.load()[specs.structure_of(tree)]
    alone = ways.single(structure, tree)
    return list(dict.fromkeys([*([] if alone is None else [alone]), *ways.fastest(structure, tree)]))


def document(folder: Path) -> Any:
    return json.loads((folder / "bench.json").read_text(encoding="utf-8"))


def test_the_report_and_the_pages_of_the_inspector_link_each_other(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(inspecting, "WIDTH", 32)
    out, second = tmp_path / "out", tmp_path / "other.npz"
    second.write_bytes(scene.read_bytes())
    asked = [str(scene), str(second), *QUICK, "--inspector", "kd,bih", "--out", str(out)]
    assert bench.main(asked) == 0
    names = {"soup": "inspector.html", "other": "inspector-2.html"}
    assert document(out)["inspectors"] == names
    report = (out / "report.html").read_text(encoding="utf-8")
    sections = report.split("<section")[1:3]
    for section, (own, name) in zip(sections, names.items(), strict=True):
        assert f"<h2>{own}</h2>" in section
        assert re.findall(r'<a href="(inspector[^"]*)">', section) == [name]
        page = (out / name).read_text(encoding="utf-8")
        assert f"<h1>{own}</h1>" in page
        # The structures of the page are its own; its view has the shape of the benchmark's.
        assert re.findall(r'"spec":"([^"]*)"', page) == ["kd", "bih"]
        assert "32 × 32 camera rays" in page
        assert '<a href="report.html">' in page
    # A page that cannot be made does not end the benchmark.
    capsys.readouterr()
    monkeypatch.setattr(inspecting.page, "inspect", fail)
    assert bench.main(asked) == 0
    assert "soup: the inspector's page is left out: no room" in capsys.readouterr().out
    assert "inspectors" not in document(out)
    assert "inspector.html" not in (out / "report.html").read_text(encoding="utf-8")


def fail(*_: Any) -> None:
    raise MemoryError("no room")


def test_it_writes_all_three_files_and_ends_well(scene: Path, tmp_path: Path, capsys: Any) -> None:
    out = tmp_path / "deep" / "out"
    assert bench.main([str(scene), *QUICK, "--out", str(out)]) == 0
    found = document(out)
    assert found["schema"] == 1
    assert found["project_version"] == native.VERSION
    ours = [row for row in found["rows"] if row["spec"] != "embree"]
    assert [row["spec"] for row in ours] == expanded("kd")
    lines = (out / "bench.csv").read_text(encoding="utf-8").splitlines()
    assert len(list(csv.DictReader(lines))) == len(found["rows"])
    assert "soup" in (out / "report.html").read_text(encoding="utf-8")
    assert sorted(p.name for p in out.iterdir()) == ["bench.csv", "bench.json", "report.html", "rows.jsonl"]
    printed = capsys.readouterr().out
    assert "m false misses" in printed
    # A structure that is only named is in both tables, in each as one of its own configurations.
    assert [row["table"] for row in ours] == ["single", *["fastest"] * (len(ours) - 1)]
    assert printed.index("One ray at a time") < printed.index("As fast as it goes")


def test_it_exports_figures_and_tables_for_papers(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plots, "problem", lambda: None)
    monkeypatch.setattr(page, "as_html", lambda *_: "")
    out, again = tmp_path / "out", tmp_path / "again"
    assert bench.main([str(scene), *QUICK, "--export", "pdf,latex", "--out", str(out)]) == 0
    paper = {path.name: path.read_bytes() for path in (out / files.FOLDER).iterdir()}
    assert {"soup-table-single.tex", "soup-table-fastest.tex", "soup-tree-shapes.pdf", files.OVERVIEW} <= set(paper)
    assert b"\\texttt{kd}" in paper["soup-table-single.tex"]
    assert paper["soup-ray-work.pdf"].startswith(b"%PDF-")
    # A finished run is exported again without measuring.
    assert bench.main([str(out), "--merge", "--export", "latex", "--out", str(again)]) == 0
    tables = {path.name: path.read_bytes() for path in (again / files.FOLDER).glob("*table*")}
    assert tables == {name: content for name, content in paper.items() if "table" in name}


def test_an_answer_that_differs_is_status_1(scene: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "load", lambda: LyingNative("wrong_triangle"))
    assert bench.main([str(scene), *QUICK]) == 1


def test_an_answer_that_differs_far_from_the_origin_is_status_1_too() -> None:
    right, wrong = everything("kd", 1.0), everything("kd-sah", 1.0)
    assert bench.status([right, wrong]) == 0
    wrong["offsets"][2]["wrong"] = 3
    assert bench.status([right, wrong]) == 1
    # A walk that is asked to do without its error bounds errs there, and is measured for that.
    assert bench.status([right, {**wrong, "spec": "kd-sah:robust=none"}]) == 0


def test_a_second_run_measures_nothing_again_and_other_options_are_other_rows(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: Any) -> Any:
        raise AssertionError("a finished row was measured again")

    monkeypatch.setattr(workload, "SCENES", tmp_path)
    out = tmp_path / "out"
    # A scene of the shared folder is called by its name.
    assert bench.main(["soup", *QUICK, "--threads", "0", "--out", str(out)]) == 0
    before = document(out)["rows"]
    assert (before[-1]["scene"], before[-1]["threads"]) == ("soup", os.cpu_count())
    with monkeypatch.context() as patched:
        patched.setattr(benchmark, "events", never)
        assert bench.main([str(scene), *QUICK, "--threads", "0", "--out", str(out)]) == 0
    assert document(out)["rows"] == before
    assert bench.main(["soup.npz", *QUICK, "--threads", "0", "--ray-seed", "2", "--out", str(out)]) == 0
    entries = results.Journal(out).entries.values()
    assert len([entry for entry in entries if entry.row["spec"] == "kd"]) == 2


def test_a_stopped_run_goes_on_where_it_was(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    both = [*FAST, "--structures", "kd,kd-sah"]
    real = benchmark.events

    def stopped(*arguments: Any) -> Any:
        for event in real(*arguments):
            yield event
            if isinstance(event, benchmark.Finished) and event.row["spec"] == "kd":
                raise KeyboardInterrupt

    monkeypatch.setattr(benchmark, "events", stopped)
    assert bench.main([str(scene), *both, "--out", str(out)]) == 130
    assert capsys.readouterr().err == f"bench: stopped; what was finished is kept in {out}\n"
    asked: list[str] = []

    def counted(module: Any, loaded: Any, chosen: list[str], *rest: Any) -> Any:
        asked.extend(chosen)
        return real(module, loaded, chosen, *rest)

    monkeypatch.setattr(benchmark, "events", counted)
    assert bench.main([str(scene), *both, "--out", str(out)]) == 0
    # Its anchor is measured again next to it.
    own = [spec for spec in asked if spec != "embree"]
    assert own[-1].startswith("kd-sah")
    assert "kd" not in own or yardstick.problem() is not None
    finished = [row["spec"] for row in document(out)["rows"] if row["spec"] != "embree"]
    assert finished == [*expanded("kd"), *expanded("kd-sah")]


def own_rays(path: Path, **more: Any) -> Path:
    """A file with 300 rays from a sphere around the scene towards its middle."""
    rng = np.random.default_rng(2)
    origins = rng.normal(size=(300, 3))
    origins *= 6 / np.linalg.norm(origins, axis=1, keepdims=True)
    aims = rng.normal(scale=0.5, size=(300, 3)) - origins
    np.savez(path, **{"origins": origins, "directions": aims, **more})
    return path


def test_rays_of_a_file_are_further_sets(scene: Path, tmp_path: Path, capsys: Any) -> None:
    mine, out = own_rays(tmp_path / "mine.npz", any=True), tmp_path / "out"
    words = [str(scene), *QUICK, "--out", str(out)]
    assert bench.main([*words, "--rays", f"primary,{mine}"]) == 0
    assert "mine" in capsys.readouterr().out
    rows = [row for row in document(out)["rows"] if not yardstick.is_foreign(row["spec"])]
    for row in rows:
        assert list(row["rays"]) == ["primary", "mine"]
        assert row["rays"]["mine"]["n"] == 300
        assert 0 < row["rays"]["mine"]["hits"] < 1
        assert row["errors"]["sets"]["mine"]["rays"] == 128
    # Other rays of the same name are measured, and never shown in one report.
    own_rays(mine, any=True, t_max=0.9)  # in lengths of the directions
    again = tmp_path / "again"
    assert bench.main([*words[:-1], str(again), "--rays", f"primary,{mine}"]) == 0
    (other,) = (row for row in document(again)["rows"] if row["spec"] == rows[0]["spec"])
    assert other["rays"]["mine"]["hits"] < rows[0]["rays"]["mine"]["hits"]
    assert bench.main([str(out), str(again), "--merge", "--out", str(tmp_path / "merged")]) == 2
    assert "different --rays" in capsys.readouterr().err
    # Files alone are enough, and one set of a file.
    rays = {f"{name}/{key}": array for name in "ab" for key, array in np.load(mine).items() if key in ray_files.KEYS}
    np.savez(tmp_path / "two.npz", **rays)
    assert bench.main([str(scene), *QUICK, "--rays", f"{tmp_path / 'two.npz'}:b", "--out", str(tmp_path / "b")]) == 0
    assert {tuple(row["rays"]) for row in document(tmp_path / "b")["rows"]} == {("b",)}
    assert bench.main([str(scene), *QUICK, "--rays", f"{tmp_path / 'two.npz'}:c"]) == 2
    assert "there is no ray set 'c'; there are a, b" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--structures", "octopus"], "unknown structure 'octopus'; there are kd"),
        (["--structures", "kd:colour=3"], "has no key 'colour'"),
        (["--structures", "kd:max_depth=999"], "max_depth"),
        (["--k", "9-2"], "runs backwards"),
        (["--structures", "kd", "--k", "3"], "parameter 'k'"),
        (["--rays", "primary,sideways"], "unknown set 'sideways'"),
        (["--rays", "nowhere.npz"], "nowhere.npz: cannot be read as .npz: "),
        (["--size", "100x100"], "multiples of 8"),
        (["--size", "0x8"], "multiples of 8"),
        (["--size", "big"], "WIDTHxHEIGHT"),
        (["--repeats", "0"], "--repeats: expected 1 to 1000"),
        (["--threads", "-1"], "--threads: expected 0 to 1024"),
        (["--level", "mmx"], "--level: expected best, "),
        (["--check-rays", "many"], "invalid int value"),
        (["--curve", "0,2"], "numbers of samples"),
        (["--reference", "hearsay"], "invalid choice"),
        (["--curve", "lots"], "expected a number"),
        (["--seconds", "0"], "--seconds: expected more than 0"),
        (["--shard", "3/2"], "--shard: expected I/N"),
        (["--structures", "kd:max_depth=9..3"], "runs backwards"),
        (["--cluster", "local:none"], "local:N"),
        (["--cluster", "local:1025"], "local:N with N workers, 1 to 1024"),
        (["--published", "nowhere.json"], "--published: nowhere.json"),
        (["--export", "pdf,docx"], "--export: unknown format 'docx'; there are pdf, pgf, latex"),
        (["--export", "pgf", "--shard", "1/2"], "--export: expected --out, and no --shard"),
        (["--inspector", "kd", "--shard", "1/2"], "--inspector: expected --out, and no --shard"),
        (["--inspector", "kd,tree"], "unknown structure 'tree'"),
        (["--merge", "--inspector", "kd"], "--inspector: expected no --merge"),
        (["--wrong"], "unrecognized arguments"),
        (["missing.npz"], "missing.npz: cannot be read: No such file"),
        (["scene.xyz"], "expected grid, showcase or a file ending in"),
    ],
)
def test_bad_usage_is_one_line_and_status_2(
    scene: Path, tmp_path: Path, capsys: Any, arguments: list[str], message: str
) -> None:
    out = tmp_path / "out"
    asked = arguments if not arguments[0].startswith("-") else [str(scene), *arguments]
    assert bench.main([*asked, "--out", str(out)]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line]
    assert len(lines) == 1
    assert message in lines[0]
    assert not out.exists(), "nothing is written before everything is known to be right"


def test_two_scenes_of_one_name_are_refused(scene: Path, tmp_path: Path, capsys: Any) -> None:
    """A report tells scenes by their names, and would rank the rows of both among each other."""
    other = tmp_path / "other" / scene.name
    other.parent.mkdir()
    other.write_bytes(scene.read_bytes())
    assert bench.main([str(scene), str(other), *QUICK]) == 2
    assert "expected different names, which identify them in reports" in capsys.readouterr().err
    # The same file twice is one scene, however it is called.
    again = str(other.parent / ".." / scene.name)
    assert bench.main([str(scene), str(scene), again, *QUICK, "--out", str(tmp_path / "out")]) == 0
    assert [row["spec"] for row in document(tmp_path / "out")["rows"] if row["spec"] != "embree"] == expanded("kd")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["CUT", *QUICK], "cut.npz: cannot be read as .npz"),
        (["SCENE", *QUICK, "--out", "SCENE/inside"], "cannot be written"),
        (["--preset", "thesis"], "none of its scenes"),
    ],
)
def test_rejects_arguments_that_cannot_be_measured_or_written(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any, words: list[str], said: str
) -> None:
    monkeypatch.setattr(workload, "SCENES", tmp_path)
    cut = tmp_path / "cut.npz"
    cut.write_bytes(scene.read_bytes()[:300])
    assert bench.main([word.replace("SCENE", str(scene)).replace("CUT", str(cut)) for word in words]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert said in error


def test_of_several_scenes_a_broken_one_does_not_stop_the_others(scene: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.npz"
    broken.write_bytes(b"PK")
    out = tmp_path / "out"
    assert bench.main([str(broken), str(scene), *QUICK, "--out", str(out)]) == 2
    rows = document(out)["rows"]
    assert {row["scene"] for row in rows} == {str(broken), "soup"}
    (failed,) = (row for row in rows if row["scene"] == str(broken))
    assert failed["error"].startswith(f"{broken}: cannot be read as .npz")
    assert "cannot be read as .npz" in (out / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("error", [RuntimeError("no picture\nat all"), MemoryError("no room"), ValueError("no sense")])
def test_of_several_scenes_one_that_cannot_be_measured_does_not_stop_the_others(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any, error: Exception
) -> None:
    first = scene.rename(tmp_path / "first.npz")
    scene.write_bytes(first.read_bytes())
    real = benchmark.events

    def failing(module: Any, loaded: Any, *rest: Any) -> Any:
        for event in real(module, loaded, *rest):
            yield event
            is_first = isinstance(event, benchmark.Finished) and event.row["spec"] == "kd:traversal=auto"
            if loaded.name == "first" and is_first:
                raise error

    monkeypatch.setattr(benchmark, "events", failing)
    out = tmp_path / "out"
    asked = "kd:traversal=auto,kd-sah:traversal=auto"
    assert bench.main([str(first), str(scene), *FAST, "--structures", asked, "--out", str(out)]) == 2
    line = str(error).splitlines()[0]
    assert capsys.readouterr().err == f"bench: first: {line}\n"
    rows = [(row["scene"], row["spec"], row["error"]) for row in document(out)["rows"] if row["spec"] != "embree"]
    first, second = asked.split(",")
    assert rows == [("first", first, None), ("first", "", line), ("soup", first, None), ("soup", second, None)]
    assert line in (out / "report.html").read_text(encoding="utf-8")


def test_one_configuration_in_other_words_is_one_row(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    asked = ["--structures", "kd:,kd,kd:traversal=auto,kd:max_depth=9,traversal=dir,kd:traversal=dir,max_depth=9"]
    assert bench.main([str(scene), *FAST, *asked, "--out", str(out)]) == 0
    found = [row["spec"] for row in document(out)["rows"] if row["spec"] != "embree"]
    assert found[-1] == "kd:max_depth=9,traversal=dir"
    assert found[:-1] == expanded("kd")


def test_rays_to_compare_bind_the_scenes_own_sets_where_they_are_named() -> None:
    named, usual = (bench.read_options(bench.parser().parse_args(words), 1) for words in (["--check-rays", "128"], []))
    assert (named.check_rays, named.own_rays) == (128, 128)
    assert (usual.check_rays, usual.own_rays) == (20_000, None)
    assert (named.check_tests, usual.check_tests) == (None, bench.CHECK_TESTS)


def test_the_work_of_the_reference_is_bounded_and_the_rays_counted(scene: Path, monkeypatch: Any, capsys: Any) -> None:
    # A hundred triangles and four sets: two blocks of each set.
    monkeypatch.setattr(bench, "CHECK_TESTS", 4 * 100 * 191)
    words = [word for word in QUICK if word not in ("--check-rays", "128")]
    for more, wanted in (([], 128), (["--check-rays", "192"], 192)):
        assert bench.main([str(scene), *words, *more]) == 0
        printed = capsys.readouterr().out
        assert f" on {4 * wanted:,} rays each" in printed
        assert ("128 rays per set compared, not 20,000" in printed) == (not more)


def test_a_preset_names_scenes_structures_and_rays(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workload, "SCENES", tmp_path)
    scene.rename(tmp_path / "conference.npz")
    out = tmp_path / "out"
    assert bench.main(["--preset", "beams", *FAST, "--out", str(out)]) == 0
    row = document(out)["rows"][-1]
    assert (row["scene"], row["tree"], list(row["rays"])) == ("conference", "kd", ["primary", "shadow"])


def test_the_thesis_is_repeated_on_what_of_a_scene_it_measured(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setattr(workload, "SCENES", tmp_path)
    with np.load(scene) as file:
        arrays = dict(file)
    count = len(arrays["triangles"])
    np.savez(tmp_path / "conference.npz", **arrays, triangle_from_quadric=np.arange(count) % 2)
    swept = ["--structures", "bsp-wn-plus-kd", "--k", "3", "--seeds", "1"]
    for preset, asked, kept in ("directions", swept, (count + 1) // 2), ("beams", [], count):
        out = tmp_path / preset
        assert bench.main(["--preset", preset, *FAST, *asked, "--out", str(out)]) == 0
        assert document(out)["rows"][-1]["triangles"] == kept
        assert ("that replace quadrics are left out:" in capsys.readouterr().out) == (kept < count)


@pytest.mark.parametrize("name", ["thesis", "directions"])
def test_trees_of_a_sweep_are_walked_as_the_kd_tree_that_they_are_compared_with(name: str) -> None:
    chosen = specs.split(bench_presets.PRESETS[name]["structures"])
    assert chosen[0] in benchmark.BASES
    assert len(chosen) > 10
    assert all("traversal=dir" in spec for spec in chosen)


def test_a_report_names_the_instruction_set_that_was_used(scene: Path, tmp_path: Path) -> None:
    module = native.load()
    best = module.level()
    least = "sse4.2" if best in ("avx512", "avx2") else best
    try:
        assert bench.main([str(scene), *QUICK, "--level", least, "--out", str(tmp_path / "out")]) == 0
    finally:
        module.use_level("best")
    found = document(tmp_path / "out")
    assert (found["machine"]["level"], found["options"]["level"]) == (least, least)
    assert module.level() == best


def test_arguments_follow_two_dashes_as_inside_blender(scene: Path) -> None:
    command = [sys.executable, str(BENCH), "--background", "--python", "bench.py", "--", str(scene), *QUICK]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert "soup: 100 triangles" in done.stdout


ONE = np.array([[-9, 0, -9], [9, 0, -9], [0, 0, 9]])


@pytest.mark.parametrize(
    ("corners", "target", "hits"),
    [(ONE, [0, 0, 1], True), (ONE, [0, -10, 0], False), (np.full((3, 3), 0.5), [0, 0, 0], False)],
    ids=["one triangle", "no hits", "a point"],
)
def test_scenes_with_equal_answers_or_none_have_tables_without_nan(
    tmp_path: Path, capsys: Any, corners: Any, target: list[float], *, hits: bool
) -> None:
    path = saved(tmp_path / "poor.npz", corners, target)
    out = tmp_path / "out"
    asked = ["--structures", "kd,octree-net", "--size", "32x32", "--repeats", "6", "--check-rays", "64", "--curve", "1"]
    assert bench.main([str(path), *asked, "--only-rays", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "nan" not in printed.lower()
    assert "poor: 1 triangle" in printed
    assert ("none hits the scene" in printed) != hits
    found: list[str] = []
    json.loads((out / "bench.json").read_text(encoding="utf-8"), parse_constant=found.append)
    assert found == []
    assert [row["error"] for row in document(out)["rows"]] == [None] * len(document(out)["rows"])
    assert "nan" not in (out / "bench.csv").read_text(encoding="utf-8").lower().replace("instance", "")
    for table in ("One ray at a time", "As fast as it goes"):
        assert table in printed


def test_many_configurations_get_fewer_repeats_but_as_many_checks(scene: Path, monkeypatch: Any, capsys: Any) -> None:
    few, many = (bench.read_options(bench.parser().parse_args([str(scene)]), count) for count in (4, bench.MANY + 1))
    assert (few.repeats, few.brief) == (bench.REPEATS, False)
    assert (many.repeats, many.brief, many.scaling) == (bench.FEWER, True, False)
    assert many.pass_seconds < few.pass_seconds
    assert (many.check_rays, many.own_rays, many.sets, many.reference) == (
        few.check_rays,
        few.own_rays,
        few.sets,
        few.reference,
    )
    named = bench.read_options(bench.parser().parse_args(["--repeats", "9", "--curve", "2"]), bench.MANY + 1)
    assert (named.repeats, named.curve) == (9, (2,)), "what is asked for is kept"
    # What only a report shows is measured for a report.
    written = bench.read_options(bench.parser().parse_args(["--out", "report"]), bench.MANY + 1)
    assert (written.curve, written.peak, written.maps) == (few.curve, True, True)
    assert (few.peak, few.maps, few.curve) == (True, True, tuple(2**i for i in range(9)))
    assert (many.curve, many.peak, many.maps) == ((), False, False)
    # It is printed, and in a brief run only the usually quickest configuration of a tree gets all measurements.
    monkeypatch.setattr(bench, "MANY", 1)
    found: list[dict[str, Any]] = []
    monkeypatch.setattr(bench, "status", lambda rows: found.extend(rows) or 0)
    asked = ["--structures", "kd", "--size", "32x32", "--check-rays", "128", "--seconds", "1", "--curve", "1,2"]
    assert bench.main([str(scene), *asked, "--out", str(scene.with_suffix(""))]) == 0
    assert "configurations are more than 1: fewer timed rays and 6 repeats each" in capsys.readouterr().out
    ours = {row["spec"]: row for row in found if row["spec"] != "embree"}
    whole = [spec for spec, row in ours.items() if [point["spp"] for point in row["curve"]] == [1, 2]]
    assert whole == ["kd:nodes=boxes"]
    assert all([point["spp"] for point in row["curve"]] == [1] for spec, row in ours.items() if spec not in whole)
    assert [spec for spec, row in ours.items() if row["peak_bytes"] is not None] == whole
    assert {"kd:traversal=dir", "kd"} < set(ours)
    assert {row["errors"]["rays"] for row in ours.values()} == {4 * 128}


@pytest.mark.skipif(yardstick.problem() is not None, reason="without Embree there is nothing to divide by")
def test_a_history_grows_by_a_line_a_run(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "speed.jsonl"
    for commit in ("a", "b"):
        monkeypatch.setattr(history, "commit", lambda _, commit=commit: commit * 40)
        assert bench.main([str(scene), *QUICK, "--history", str(file)]) == 0
    lines = history.read(file)
    assert [line["commit"][0] for line in lines] == ["a", "b"]
    assert all(set(line["ratios"]) == set(expanded("kd")) for line in lines)
    assert lines[0]["scene"] == "soup"
    assert lines[0]["machine"]["level"] == native.load().level()
    # Refuse what would be no history before anything is measured.
    capsys.readouterr()
    file.write_text("nonsense", encoding="utf-8")
    assert bench.main([str(scene), *QUICK, "--history", str(file)]) == 2
    assert "--history: " in (said := capsys.readouterr().err)
    assert "line 1 is no line of speeds" in said
    monkeypatch.setattr(history, "commit", lambda _: "")
    assert bench.main([str(scene), *QUICK, "--history", str(tmp_path / "other")]) == 2
    assert "needs a clone" in capsys.readouterr().err
