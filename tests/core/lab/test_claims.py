# SPDX-License-Identifier: GPL-3.0-or-later
"""The claims: every one is measured next to checked answers, and a wrong answer is told."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import halfspace_native
import numpy as np
import pytest

from addon.core.base import native
from addon.core.measure import yardstick
from addon.core.measure.accuracy import Errors
from addon.core.report import results
from addon.core.scene import workload
from addon.core.structures import specs
from addon.lab.claims import (
    any_hits as claims_any_hits,
)
from addon.lab.claims import (
    beams as claims_beams,
)
from addon.lab.claims import (
    claims,
    document,
    published,
    statements,
)
from addon.lab.claims import (
    families as claims_families,
)
from addon.lab.claims import (
    growth as claims_growth,
)
from addon.lab.claims import (
    intervals as claims_intervals,
)
from addon.lab.claims import (
    kd as claims_kd,
)
from addon.lab.claims import (
    medians as claims_medians,
)
from addon.lab.claims import (
    mirrors as claims_mirrors,
)
from addon.lab.claims import (
    moving as claims_moving,
)
from addon.lab.claims import (
    orderings as claims_orderings,
)
from addon.lab.claims import (
    oriented as claims_oriented,
)
from addon.lab.claims import (
    paper_scenes as claims_scenes,
)
from addon.lab.claims import (
    polygons as claims_polygons,
)
from addon.lab.claims import (
    report as claims_report,
)
from addon.lab.claims import (
    shadows as claims_shadows,
)
from addon.lab.claims import (
    table as claims_table,
)
from addon.lab.claims import (
    thesis as claims_thesis,
)
from addon.lab.claims import (
    voxels as claims_voxels,
)
from addon.lab.claims.claims import FAILS, HOLDS, UNCLEAR, UNTESTED, VERDICTS, Claim, Lab, Outcome, Timing
from addon.lab.commands import claims as command
from tests.lying_native import LIES, LyingNative

THESIS_SCENES = claims_thesis.scenes
WITHOUT_RAYS = {"sweep-trees-linear"}
"""Claims about trees that no rays meet."""


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Small pictures and one repeat: what is tested is that all is measured, not how fast it is."""
    monkeypatch.setattr(claims_scenes, "RESOLUTIONS", ((32, 24), (64, 48)))
    monkeypatch.setattr(claims_shadows, "SHADOW_SIZE", (128, 128))
    monkeypatch.setattr(claims_any_hits, "SIZE", (64, 64))
    monkeypatch.setattr(claims_beams, "ABOVE", (64, 48))
    monkeypatch.setattr(claims_polygons, "LARGEST", (64, 48))
    monkeypatch.setattr(claims_polygons, "SIDE", 2)
    monkeypatch.setattr(claims_kd, "SIZE", (32, 32))
    monkeypatch.setattr(claims_mirrors, "SIZE", (64, 48))
    monkeypatch.setattr(claims_intervals, "SIZE", (32, 32))
    monkeypatch.setattr(claims_growth, "SIZE", (32, 32))
    monkeypatch.setattr(claims_growth, "COUNTS", dict.fromkeys((True, False), (500, 1000, 2000)))
    monkeypatch.setattr(claims_moving, "SIZE", (32, 32))
    monkeypatch.setattr(claims_moving, "FRAMES", dict.fromkeys((True, False), range(9, 11)))
    monkeypatch.setattr(claims, "REPEATS", {True: 1, False: 1})
    monkeypatch.setattr(claims, "BUILDS", {True: 1, False: 1})
    monkeypatch.setattr(claims_families, "DEPTHS", (0.5, 8.0))
    # Embree takes the place of tracers that cargo would have to build.
    places = ("tinybvh-bvh", "tinybvh-bvh8", "embree-best", "embree-packets")
    makers = {yardstick.PEER + name: yardstick.EmbreeStructure for name in places}
    monkeypatch.setattr(yardstick, "MAKERS", {**yardstick.MAKERS, **makers})
    monkeypatch.setattr(workload, "SCENES", tmp_path)
    monkeypatch.setattr(claims_thesis, "scenes", lambda _: [("leg", claims_scenes.concentrated())])


def test_the_scenes_have_the_published_numbers_of_objects_and_nodes() -> None:
    for made, objects, nodes in ((claims_scenes.scattered(), 400, 1250), (claims_scenes.concentrated(), 60, 450)):
        assert len(made.triangles) == objects
        statistics = halfspace_native.build(made.vertices, made.triangles, "octree-net").statistics
        count = statistics["nodes_axis"] + statistics["leaves"]
        assert abs(count / nodes - 1) < 0.05
        # Six links a leaf, but for those that lead out of the tree.
        assert 4 * statistics["leaves"] < statistics["links"] < 6 * statistics["leaves"]
        assert statistics["bytes"] > 16 * count + 24 * statistics["leaves"]


def test_the_window_is_the_same_at_every_resolution() -> None:
    made = claims_scenes.scattered()
    small, large = (claims_scenes.camera_rays(made, size) for size in ((32, 24), (128, 64)))
    assert len(small) == 32 * 24
    angles = [np.degrees(np.arccos(rays.directions @ rays.directions[0])).max() for rays in (small, large)]
    assert angles[0] == pytest.approx(angles[1], rel=0.05)


def test_all_claims_are_measured_and_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(["--quick", "--out", str(tmp_path)]) == 0
    rows = json.loads((tmp_path / "claims.json").read_text())["rows"]
    page, text = (tmp_path / "claims.html").read_text(), capsys.readouterr().out
    assert {row["claim"] for row in rows} == {claim.id for claim in claims_table.CLAIMS}
    for row in rows:
        assert row["verdict"] in VERDICTS
        assert row["configuration"] in ("faithful", "best")
        assert row["measured"] in text
        if row["verdict"] == UNTESTED and not row["values"]:
            continue
        # Configurations without bounds are wrong here and there.
        checked = row["checked"]
        assert not checked["wrong"] or any("robust=none" in spec for spec in checked["specs"])
        assert checked["wrong"] == sum(checked[kind] for kind in ("wrong_triangle", "false_hits", "last_bits"))
        assert checked["count"] or row["claim"] in WITHOUT_RAYS
        assert row["error"] in text
        assert row["why"]
        if row["why"].startswith("per ray: kd "):
            assert "are counted one by one" not in row["why"], "the kernels of kd count themselves"
    for claim in claims_table.CLAIMS:
        assert f'id="{claim.id}"' in page
    assert "http" not in page.replace("http://www.w3.org", "").replace("http://purl.org", "").replace(
        "http://creativecommons.org", ""
    ).replace("https://matplotlib.org", "")


class Stocked(Lab):
    """A lab that has every shared scene, each a small one, and leaves out no structure that this build has not."""

    def shared(self, name: str, *, published: bool = False) -> workload.Workload:
        return dataclasses.replace(claims_scenes.concentrated(), name=name)

    def lacks(self, *specs: str) -> str:
        for spec in specs:
            self.build(claims_scenes.concentrated(), spec)
        return ""


@pytest.mark.parametrize("claim", claims_table.CLAIMS, ids=lambda claim: claim.id)
def test_every_configuration_of_a_claim_exists(claim: Claim, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows labelled faithful name their configurations, and those are in published form."""
    monkeypatch.setattr(claims_thesis, "scenes", THESIS_SCENES)
    lab = Stocked(halfspace_native, quick=True, say=lambda _: None)
    lab.repeats = 1
    result = claims.Result(claim, tuple(claim.measure(lab)))
    assert result.measured
    for one in result.outcomes:
        if one.configuration == "faithful" and one.verdict != UNTESTED and claim.id not in WITHOUT_RAYS:
            assert one.checked.specs
            assert [text for spec in one.checked.specs if (text := published.problem(halfspace_native, spec))] == []


@pytest.mark.parametrize(
    ("spec", "told"),
    [
        ("bbox-gs", "fanout=limited, where any is published"),
        ("bbox-gs:fanout=any,leaf_size=2", "leaf_size=2, where 1 is published"),
        ("bbox-gs:fanout=any,leaf_size=1", "leaves=indices, where scalar is published"),
        ("bbox-gs:fanout=any,leaf_size=1,leaves=scalar", ""),
        ("octree-net:leaf_size=2", "leaves=blocks, where scalar is published"),
        ("octree-net:leaf_size=2,leaves=scalar", ""),
        ("bih:traversal=ordered", "leaves=indices, where scalar is published"),
        ("bih:traversal=ordered,leaves=scalar", ""),
        ("bih:traversal=ordered,robust=none", ""),
        ("bih:traversal=packet", ""),
        ("bvh-sah:width=2,traversal=ordered", "leaves="),
        ("octree-beam", "traversal=beam, where polygon is published"),
        ("octree-beam:traversal=polygon,leaf_size=8", "leaf_size=8"),
        ("octree-beam:traversal=polygon,beam_min=64", ""),
        ("kd-sah", "traversal=auto"),
        ("bsp-wn-plus-kd:k=3,costs=thesis,ties=pbrt,clip=0,traversal=dir,leaves=scalar", ""),
        ("bsp-wn-plus-kd:k=6,costs=thesis,ties=pbrt,clip=0,traversal=dir,leaves=scalar", "slab=1"),
        ("grid", "no published form"),
        ("embree", ""),
    ],
)
def test_configurations_in_published_form(spec: str, told: str) -> None:
    found = published.problem(halfspace_native, spec)
    assert told in found
    assert bool(found) == bool(told)


def test_every_published_form_exists() -> None:
    made = claims_scenes.concentrated()
    every = ((name, form) for name, forms in published.FORMS.items() for form in forms.split(" or "))
    for name, form in every:
        first = (f"{key}={value.partition('|')[0]}" for key, value in specs.pairs(f"{name}:{form}"))
        halfspace_native.build(made.vertices, made.triangles, specs.joined(name, *first))


def test_every_claim_of_the_four_sources_stands_in_the_table_of_statements() -> None:
    known = {claim.id for claim in claims_table.CLAIMS}
    named = {claim for one in statements.STATEMENTS for claim in one.claims}
    assert named <= known
    sources = {claims_kd.PAPER, claims_intervals.PAPER, claims_beams.PAPER, claims_thesis.PAPER}
    # Beams of parallel rays are ours.
    assert {claim.id for claim in claims_table.CLAIMS if claim.paper in sources} - named == {"beams-parallel"}
    for one in statements.STATEMENTS:
        assert bool(one.claims) != bool(one.untested)
        assert len(one.untested.split()) <= 6


def test_the_document_has_the_table_of_statements() -> None:
    text = (Path(__file__).parents[3] / "docs" / "papers.md").read_text(encoding="utf-8")
    rows = {one.says: f"| {one.says} | {', '.join(f'`{c}`' for c in one.claims)} |" for one in statements.STATEMENTS}
    assert [says for says, row in rows.items() if row not in text] == []


def test_the_table_has_the_verdicts_of_the_last_measurement(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(["table"]) == 2
    assert "--out names the folder" in capsys.readouterr().err
    assert command.main(["sweep-trees-linear", "links-gain", "--quick", "--out", str(tmp_path)]) == 0
    assert command.main(["sweep-trees-linear", "--quick", "--out", str(tmp_path)]) == 0
    assert command.main(["table", "--out", str(tmp_path)]) == 0
    lines = (tmp_path / "statements.md").read_text().splitlines()
    (linear,) = (line for line in lines if "`sweep-trees-linear`" in line)
    assert linear.endswith("| as published holds (1 of 2), does not hold (1 of 2) |")
    (links,) = (line for line in lines if "`links-gain`" in line)
    assert "as published " in links
    assert "ours " in links
    assert sum(line.endswith(f"| {statements.UNMEASURED} |") for line in lines) > 20


def outcome_row(claim: str, configuration: str, measured: str, **values: float) -> dict[str, Any]:
    made = Outcome(configuration, HOLDS, measured, "per ray: 7 nodes", claims.Checked(("kd",), 96_000), values)
    (row,) = claims.Result(Claim(claim, "paper", "says", lambda _: ()), (made,)).as_rows()
    return row


ROWS = [
    outcome_row("a", "faithful", "hall, 400 triangles: 0.25 of it", ratio=0.25, long=1234.5),
    outcome_row("a", "best", "hall (9 nodes): 31.5 of it", ratio=31.52, long=1234.5),
    outcome_row("b", "best", "room: 3 of it", other=0.0012),
]


def test_the_tables_of_a_document_are_written_from_measured_claims() -> None:
    def page(first: str, second: str) -> str:
        return (
            f"<!-- claims: a b; ours = ratio; long = lo; other = other; of = #count -->\n{first}{document.END}\n"
            f"<!-- claims: b -->\n{second}{document.END}\n<!-- claims: c -->\nkept\n{document.END}\n"
        )

    assert document.written(page("old\n", "old\n"), ROWS) == page(
        "| scene | ours | long | other | of |\n| --- | ---: | ---: | ---: | ---: |\n"
        "| hall | 0.25 / 31.5 | 1,234 |  | 96,000 |\n| room |  |  | 0.001 | 96,000 |\n",
        "| claim | | verdict | measured |\n| --- | --- | --- | --- |\n| `b` | ours | holds | room: 3 of it |\n",
    )
    assert "| `links-gain` |" in document.written(f"<!-- claims: statements -->\n{document.END}", ROWS)
    with pytest.raises(ValueError, match="no outcome has a value of 'none'"):
        document.written(f"<!-- claims: a; x = none -->\n{document.END}", ROWS)
    with pytest.raises(ValueError, match="expected <!-- claims: end"):
        document.written("<!-- claims: a -->\n", ROWS)


def test_sentences_with_other_numbers_are_listed() -> None:
    text = (
        "It was 99.\n\n## One\nOf claim `a`, 2019: 0.25 of it. It was 7 nodes; it is 8 of 1,234. None of 96,000.\n"
        "```sh\nrun 64\n```\n| 65 |\n<!-- claims: a -->\n66\n<!-- claims: end -->\n\n## Two\n67 of `a-b`.\n"
    )
    assert list(document.doubtful(text, ROWS)) == ["8: it is 8 of 1,234."]


def test_the_tables_of_the_document_name_claims_that_exist(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    known = {claim.id for claim in claims_table.CLAIMS}
    text = "".join(page.read_text(encoding="utf-8") for page in command.PAGES)
    named = {name for found in document.BLOCK.findall(text) for name in found[0].partition(";")[0].split()}
    assert named - {document.STATEMENTS} <= known
    page = tmp_path / "papers.md"
    page.write_text("It is so.\n\n<!-- claims: links-gain -->\nstale\n<!-- claims: end -->\nIt is 12345.\n", "utf-8")
    monkeypatch.setattr(command, "PAGES", (page,))
    out = tmp_path / "out"
    assert command.main(["links-gain", "--quick", "--out", str(out)]) == 0
    assert command.main(["table", "--write", "--out", str(out)]) == 0
    assert "| `links-gain` | as published |" in page.read_text("utf-8")
    assert "stale" not in page.read_text("utf-8")
    assert "not among the numbers measured: 12345: It is 12345." in capsys.readouterr().out


def test_a_limit_within_the_noise_is_neither_kept_nor_missed() -> None:
    own, other = (Timing(1, seconds, {}, (seconds,) * 6) for seconds in (1.0, 1.01))
    assert own.share(other).below() == other.share(own).below() == UNCLEAR
    assert (own.share(other).below(1.1), own.share(other).below(0.9)) == (HOLDS, FAILS)
    assert (own.share(other).above(0.9), own.share(other).above(1.1)) == (HOLDS, FAILS)
    # Passes that differ widen the interval beyond the margin.
    noisy = Timing(1, 1.0, {}, (0.7, 0.8, 0.9, 1.1, 1.2, 1.3))
    steady = Timing(1, 1.1, {}, (1.1,) * 6)
    assert noisy.share(steady).below() == UNCLEAR
    assert Timing(1, 1.0, {}).share(steady).below() == HOLDS
    assert claims.verdict(HOLDS, UNCLEAR) == UNCLEAR
    assert claims.verdict(UNCLEAR, FAILS) == FAILS
    assert claims.verdict(HOLDS, UNCLEAR, holds=False) == FAILS
    assert claims.verdict() == HOLDS


def test_wrong_answers_are_told_by_kind() -> None:
    errors = [Errors(rays=9, wrong=6, wrong_triangle=1, last_bits=3), Errors(rays=1, wrong=1, false_miss=1)]
    found = claims.Checked.of(["kd"], errors)
    assert str(found) == (
        "7 of 10 answers differ from brute force: 1 on another triangle, 3 false hits or misses, 3 in last bits only"
    )
    page = claims_report.as_html(
        [claims.Result(Claim("id", "paper", "says", lambda _: ()), (Outcome("best", HOLDS, "x", checked=found),))],
        {},
        quick=True,
    )
    assert "<td>1</td><td>3</td><td>3</td><td>10 answers</td>" in page
    pixels = claims.Checked(("kd",), 8, 2, noun="pixels")
    assert str(pixels) == "2 of 8 pixels differ from brute force"


def test_the_page_says_what_its_numbers_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(claims_report, "REPEATS", {True: 3, False: 7})
    monkeypatch.setattr(claims_report, "BUILDS", {True: 3, False: 7})
    found = [claims.Result(Claim("id", "paper", "says", lambda _: ()), (Outcome("best", HOLDS, "faster"),))]
    for quick, count in ((True, 3), (False, 7)):
        command.save(tmp_path, halfspace_native, found, quick=quick)
        page = (tmp_path / "claims.html").read_text()
        assert f"Rays: the median of {count} passes" in page
        assert f"the shortest of at most {count + 1} passes for each chunk of rays, in wall-clock time, summed" in page
        assert f"Builds: the median of {count}, or of those that begin within {20 if quick else 60} seconds" in page


def test_builds_are_medians_of_as_many_as_there_is_time_for(monkeypatch: pytest.MonkeyPatch) -> None:
    taken = iter((5.0, 50.0, 1.0, 10.0, 3.0, 30.0, 7.0, 70.0))
    monkeypatch.setattr(claims, "timed_build", lambda *_: (None, next(taken)))
    monkeypatch.setattr(claims, "BUILDS", {True: 3, False: 7})
    lab = Lab(halfspace_native, quick=True, say=lambda _: None)
    made = claims_scenes.scattered()
    for _ in range(2):  # what was measured once is not measured again
        found = lab.build_seconds(made, ["kd", "bih"])
        assert (found.seconds, found.count, found.method) == ({"kd": 3.0, "bih": 30.0}, 3, "medians of 3 builds")
    monkeypatch.setattr(claims, "BUILD_SECONDS", {True: 0, False: 0})
    found = lab.build_seconds(made, ["bih", "kd"])
    assert (found.seconds, found.method) == ({"bih": 7.0, "kd": 70.0}, "one build each")


def test_states_the_cost_of_links_for_the_measured_builds(monkeypatch: pytest.MonkeyPatch) -> None:
    seconds = iter((0.002, 0.001) * 10)
    monkeypatch.setattr(claims, "timed_build", lambda *_: (None, next(seconds)))
    lab = Lab(halfspace_native, quick=True, say=lambda _: None)
    assert all("cost 1000 µs of the build (one build each)" in one.measured for one in claims_beams.links_gain(lab))


def test_a_claim_names_the_shared_scenes_that_it_is_measured_on(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: set[str] = set()
    monkeypatch.setattr(claims_thesis, "scenes", THESIS_SCENES)
    monkeypatch.setattr(Lab, "shared", lambda _, name, **_how: asked.add(name))
    lab = Lab(halfspace_native, quick=True, say=lambda _: None)
    for claim in claims_table.CLAIMS:
        asked.clear()
        list(claims.measure(lab, [claim]))
        assert asked == set(claim.scenes), claim.id


def save_scene(path: Path, made: workload.Workload) -> None:
    view = made.view
    np.savez(
        path,
        vertices=made.vertices,
        triangles=made.triangles,
        camera_eye=view.eye,
        camera_target=view.target,
        camera_up=view.up,
        camera_vfov_deg=view.vertical_fov,
    )


def test_a_scene_that_is_put_there_or_changes_is_measured(tmp_path: Path) -> None:
    asked = ["teapot-in-the-stadium", "--quick", "--out", str(tmp_path)]

    def measured() -> list[str]:
        assert command.main(asked) == 0
        return [row["measured"] for row in json.loads((tmp_path / "claims.json").read_text())["rows"]]

    assert measured() == ["the scene utah-teapot-plane is missing"] * 2
    save_scene(tmp_path / "utah-teapot-plane.npz", claims_scenes.scattered())
    first = measured()
    assert all("ns per ray" in text for text in first)
    assert measured() == first, "nothing has changed"
    save_scene(tmp_path / "utah-teapot-plane.npz", claims_scenes.concentrated())
    other = measured()
    assert all("ns per ray" in text for text in other)
    assert not set(other) & set(first)


def test_a_shared_scene_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = tmp_path / "utah-teapot-plane.npz"
    save_scene(scene, claims_scenes.scattered())
    read: list[str] = []
    load = np.load
    monkeypatch.setattr(np, "load", lambda file, **options: read.append(file.name) or load(file, **options))
    assert command.main(["teapot-in-the-stadium", "--quick", "--out", str(tmp_path)]) == 0
    assert read == [str(scene)], "to know whether it changed, and to be measured"


def test_tries_a_failed_measurement_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = ["octrees-beat-boxes", "--quick", "--out", str(tmp_path)]
    with monkeypatch.context() as patch:
        patch.setattr(Lab, "lacks", lambda *_: "this build has no oak")
        assert command.main(asked) == 0
    assert command.main(asked) == 0
    rows = json.loads((tmp_path / "claims.json").read_text())["rows"]
    assert all(row["verdict"] != UNTESTED for row in rows)


def test_numbers_stand_beside_the_machine_that_they_were_measured_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = results.machine(halfspace_native)
    asked = ["--quick", "--out", str(tmp_path)]
    with monkeypatch.context() as patch:
        patch.setattr(results, "machine", lambda _: {**here, "name": "elsewhere", "processor": "Other CPU"})
        assert command.main(["links-gain", *asked]) == 0
    assert command.main(["links-gain", *asked]) == 0
    document, page = (tmp_path / name for name in ("claims.json", "claims.html"))
    found = json.loads(document.read_text())
    assert list(found["machines"]) == ["elsewhere"]
    assert found["machine"] == here
    assert "Other CPU" in page.read_text()
    assert "Measured on" not in page.read_text(), "there is one machine"
    assert command.main(["links-gain", "octrees-beat-boxes", *asked]) == 0
    found = json.loads(document.read_text())
    assert {row["claim"]: row["machine"] for row in found["rows"]} == {
        "links-gain": "elsewhere",
        "octrees-beat-boxes": here["name"],
    }
    assert set(found["machines"]) == {"elsewhere", here["name"]}
    assert page.read_text().count("Measured on</em> elsewhere.") == 1


def test_a_stopped_run_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = ["beams-flat-line", "--quick", "--out", str(tmp_path)]
    assert command.main(asked) == 0
    first = (tmp_path / "claims.json").read_text(), (tmp_path / "claims.html").read_text()
    monkeypatch.setattr(Lab, "seconds", lambda *_: pytest.fail("measured again"))
    assert command.main(asked) == 0
    rows = [json.loads(text)["rows"] for text in (first[0], (tmp_path / "claims.json").read_text())]
    assert rows[0] == rows[1]
    assert first[1].count("<svg") == (tmp_path / "claims.html").read_text().count("<svg")


@pytest.mark.parametrize("lie", LIES)
def test_a_wrong_answer_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], lie: str
) -> None:
    monkeypatch.setattr(native, "load", lambda: LyingNative(lie))
    asked = ["shadow-cache", "--quick", "--out", str(tmp_path)]
    for words in ("measured", "taken over: what was wrong stays wrong in a run that goes on"):
        assert command.main(asked) == 1, words
        # One answer of `kd` on each of the two scenes is a lie; the octree's answers are right.
        told = [line.partition(" of ")[0] for line in capsys.readouterr().out.splitlines() if "differ from" in line]
        assert [wrong.strip() for wrong in told] == ["0", "1", "0", "1"], words


@pytest.mark.parametrize("lie", LIES)
def test_a_wrong_answer_to_a_singular_ray_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], lie: str
) -> None:
    assert command.main(["ta-b-singularities"]) == 0, "walks without bounds are known to fail"
    capsys.readouterr()
    monkeypatch.setattr(native, "load", lambda: LyingNative(lie, "kd:traversal=ta-b", 0))
    assert command.main(["ta-b-singularities"]) == 1
    best = capsys.readouterr().out.partition("(best): ")[2]
    assert "wrong: ta-b 0" not in best
    assert "0 of" not in best.partition("cell")[2].splitlines()[-2]


def test_wrong_answers_of_one_claim_count_for_the_next() -> None:
    made = claims_scenes.scattered()
    lab = Lab(LyingNative("late"), quick=True, say=lambda _: None)

    def ask(lab: Lab) -> tuple[Outcome, ...]:
        lab.seconds(made, ["kd"], claims_scenes.camera_rays(made, (32, 24)))
        return ()

    asked = [Claim(name, "paper", "says", ask) for name in ("first", "second")]
    asked.append(Claim("third", "paper", "says", lambda _: ()))
    assert [result.wrong for result in claims.measure(lab, asked)] == [1, 1, 0]


def test_a_report_that_cannot_be_written_leaves_the_old_one(tmp_path: Path, disk_full_at_the_last: Any) -> None:
    found = [claims.Result(Claim("id", "paper", "says", lambda _: ()), (Outcome("best", HOLDS, "faster"),))]
    command.save(tmp_path, halfspace_native, found, quick=True)
    with disk_full_at_the_last(tmp_path), pytest.raises(results.FolderError, match="No space left"):
        command.save(tmp_path, halfspace_native, found, quick=False)


def test_bad_usage_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(["no-such-claim"]) == 2
    assert "unknown claim 'no-such-claim'" in capsys.readouterr().err
    assert command.main(["list"]) == 0
    assert "beams-flat-line: " in capsys.readouterr().out


def test_a_claim_fails_where_it_fails() -> None:
    lab = Lab(halfspace_native, quick=True, say=lambda _: None)
    assert lab.lacks("kd", "oak") == "this build has no oak"
    outcomes = (Outcome("faithful", claims.verdict(holds=False), "slower"), Outcome("best", HOLDS, "faster"))
    (result,) = claims.measure(lab, [Claim("id", "paper", "says", lambda _: outcomes)])
    assert FAILS.upper() in claims_report.as_text(result)
    assert claims_report.summary([result]) == "1 holds, 1 does not hold, 0 within the noise, 0 cannot be tested here"


@pytest.mark.parametrize("count", [500, 31_623])
def test_the_torus_is_closed_and_has_about_the_wanted_size(count: int) -> None:
    made = claims_growth.torus(count)
    assert abs(len(made.triangles) / count - 1) < 0.05
    edges = np.concatenate([made.triangles[:, [0, 1]], made.triangles[:, [1, 2]], made.triangles[:, [2, 0]]])
    # Each edge once in each direction, and as many corners as a torus has.
    there = np.unique(edges, axis=0)
    assert len(there) == len(edges)
    assert np.array_equal(there, np.unique(edges[:, ::-1], axis=0))
    assert len(made.vertices) - len(edges) // 2 + len(made.triangles) == 0


def test_the_rays_of_the_torus_hit_every_tessellation() -> None:
    lab = Lab(halfspace_native, quick=True, say=lambda _: None)
    sets = claims_growth.fixed_rays(lab)
    assert [(some.name, some.order) for some in sets] == [
        ("primary", "tile8"),
        (claims_growth.ALONE, "none"),
        ("diffuse", "none"),
    ]
    for count in (5_000, 40_000):
        structure = lab.build(claims_growth.torus(count), "kd")
        assert all((structure.closest(some.origins, some.directions).triangle >= 0).all() for some in sets), count


def test_fits_growth_as_n_log_n_and_log_n_exactly() -> None:
    counts = [1e4, 1e5, 1e6]
    constant, ratios = claims_growth.over_work([(n, 3e-9 * n * np.log2(n)) for n in counts])
    assert (constant, ratios) == (pytest.approx(3e-9), pytest.approx([1, 1, 1]))
    square = [(n, 1e-9 * n**2) for n in counts]
    assert claims_growth.power(square) == pytest.approx(2)
    assert max(claims_growth.over_work(square)[1]) > 5
    base, rise, ratios = claims_growth.over_line([(n, 20 + 7 * float(np.log2(n))) for n in counts])
    assert (base, rise, ratios) == (pytest.approx(20), pytest.approx(7), pytest.approx([1, 1, 1]))
    bent = list(zip(counts, [1.0, 2.0, 9.0], strict=True))
    assert claims_growth.over_line(bent)[2] == pytest.approx([1.25, 0.5, 1.25])


def test_the_claims_of_growth_depend_on_what_was_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    lab = Lab(halfspace_native, quick=True, say=lambda _: None)
    for exponent, steps, expected in ((1.0, np.log2, HOLDS), (2.0, np.square, FAILS)):

        def seconds(_: Lab, made: workload.Workload, specs: Any, exponent: float = exponent) -> claims.Builds:
            return claims.Builds(dict.fromkeys(specs, 1e-6 * len(made.triangles) ** exponent), 1)

        def timed(_: Lab, made: workload.Workload, specs: Any, rays: Any, steps: Any = steps) -> dict[str, Timing]:
            return dict.fromkeys(specs, Timing(len(rays), 1.0, {"steps": float(steps(len(made.triangles)))}))

        monkeypatch.setattr(Lab, "build_seconds", seconds)
        monkeypatch.setattr(Lab, "seconds", timed)
        for measure in (claims_growth.builds, claims_growth.lengths):
            assert {one.verdict for one in measure(lab)} == {expected}, measure


def test_the_best_plane_lies_where_the_cost_is_least() -> None:
    """Against the cost at each plane, counted one by one."""
    rng = np.random.default_rng(5)
    low, high = np.zeros(3), np.array([4.0, 2.0, 1.0])
    for _ in range(20):
        ends = np.sort(rng.uniform(0, 4, (30, 2)), axis=1)
        planes = np.unique(ends)
        surfaces = [2 * (2.0 + 2.0 * x + x) / 2 for x in planes]
        whole = 2.0 + 3.0 * 4.0
        left = np.array([(ends[:, 0] < x).sum() for x in planes])
        right = np.array([(ends[:, 1] > x).sum() for x in planes])
        cost = [s * a + (2.0 + whole - s) * b for s, a, b in zip(surfaces, left, right, strict=True)]
        best = planes[int(np.argmin(cost))] / 4.0
        even = planes[np.abs(left - right) == np.abs(left - right).min()] / 4.0
        expected = max(min(0.5, *even) - best, best - max(0.5, *even), 0.0)
        found = claims_medians.beyond(low, high, ends, 0)
        assert found == (pytest.approx(expected) if min(cost) < whole * 30 and 0 < best < 1 else None)


def test_the_best_plane_of_points_lies_between_the_medians() -> None:
    rng = np.random.default_rng(6)
    for _ in range(50):
        points = np.repeat(rng.beta(*rng.uniform(0.3, 3.0, 2), (40, 1)), 2, axis=1)
        assert claims_medians.beyond(np.zeros(3), np.ones(3), points, 2) in (0.0, None)
    assert claims_medians.beyond(np.zeros(3), np.array([1.0, 1.0, 0.0]), np.zeros((3, 2)), 2) is None, "a flat cell"


def test_the_cells_of_a_tree_are_its_nodes_with_their_triangles() -> None:
    made = claims_scenes.scattered()
    tree = halfspace_native.build(made.vertices, made.triangles, "kd-object").export()
    low, high, boxes = next(claims_medians.cells(tree, made))
    assert len(boxes) == len(made.triangles), "the first node is the root"
    assert np.all(boxes >= low - 1e-6)
    assert np.all(boxes <= high + 1e-6)
    assert boxes[:, 0].min(0) == pytest.approx(made.vertices.min(0))
    assert all(len(found) >= claims_medians.LEAST for _, _, found in claims_medians.cells(tree, made))


def test_the_claims_of_medians_cells_and_boxes_depend_on_what_was_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each holds with times or planes as its authors have them, and fails with others."""
    lab = Lab(halfspace_native, quick=True, say=lambda _: None)

    def verdicts(measure: Any, seconds: Callable[[str, int], float]) -> set[str]:
        def times(_: Lab, made: workload.Workload, specs: list[str], *, alone: bool) -> dict[str, Timing]:
            counters = {"steps": 1.0, "tests": 1.0}
            fewer = {name: 0.5 * value for name, value in counters.items()}
            own = claims_oriented.TURNED
            return {
                spec: Timing(1000, seconds(spec, len(made.triangles)), fewer if spec == own else counters)
                for spec in specs
            }

        monkeypatch.setattr(claims_kd, "times", times)
        return {one.verdict for one in measure(lab)}

    for measure, well, badly in (
        (claims_medians.constant, lambda *_: 1.0, lambda _, count: count**0.2),
        (claims_medians.surface, lambda spec, _: len(spec), lambda spec, _: 100 - len(spec)),
        (claims_voxels.step, lambda spec, _: 0.4 + spec.startswith("kd"), lambda spec, _: 2 - spec.startswith("kd")),
        (claims_voxels.mailboxes, lambda spec, _: 100 - len(spec), lambda spec, _: len(spec)),
        (claims_oriented.tighter, lambda spec, _: len(spec), lambda spec, _: 100 - len(spec)),
    ):
        assert (verdicts(measure, well), verdicts(measure, badly)) == ({HOLDS}, {FAILS}), measure
    monkeypatch.setattr(claims_medians, "beyond", lambda *_: 0.0)
    assert {one.verdict for one in claims_medians.between(lab)} == {HOLDS}
    monkeypatch.setattr(claims_medians, "beyond", lambda *_: 0.1)
    assert {one.verdict for one in claims_medians.between(lab)} == {FAILS}


def test_planes_in_depth_depend_on_the_simplest_and_the_most_complex_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    lab = Lab(halfspace_native, quick=True, say=lambda _: None)
    specs = [spec for pair in claims_families.PAIRS.values() for spec in pair]

    def verdicts(*ratios: float) -> set[str]:
        found = [
            claims_families.Scene(
                claims_scenes.scattered(),
                float(place),
                {one: Timing(1, ratio if one.startswith("kd") else 1.0, {"steps": 1.0, "tests": 1.0}) for one in specs},
                dict.fromkeys(specs, 1),
            )
            for place, ratio in enumerate(ratios)
        ]
        monkeypatch.setattr(claims_families, "kinds", lambda _: [("made", found)])
        return {one.verdict for one in claims_families.planes_in_depth(lab)}

    assert verdicts(1.5, 2.0, 0.8) == {HOLDS}
    assert verdicts(0.5, 2.0, 0.8) == verdicts(1.5, 0.5, 1.1) == {FAILS}
    assert verdicts(1.5) == {UNTESTED}


def test_rotated_boxes_pay_where_boxes_along_the_axes_do_not_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    lab = Lab(halfspace_native, quick=True, say=lambda _: None)

    def verdicts(oblique: float, along: float) -> set[str]:
        def times(_: Lab, made: workload.Workload, specs: list[str], *, alone: bool) -> dict[str, Timing]:
            own = along if made.name.endswith("axes") else oblique
            counters = {"steps": 1.0, "tests": 1.0}
            return {
                one: Timing(1, own if one.startswith("obb") and one != claims_oriented.PLAIN else 1.0, counters)
                for one in specs
            }

        monkeypatch.setattr(claims_kd, "times", times)
        return {one.verdict for one in claims_oriented.kinds(lab)}

    assert verdicts(0.9, 1.0) == {HOLDS}
    assert verdicts(1.1, 0.9) == {FAILS}
    assert verdicts(0.9, 0.9) == {HOLDS, FAILS}


def test_the_series_has_the_depth_complexity_that_it_states() -> None:
    for depth in (0.5, 8.0):
        made = claims_scenes.layered(depth)
        rays = claims_scenes.camera_rays(made, (32, 24))
        middle = rays.take(slice(0, None, 7))
        tree = halfspace_native.build(made.vertices, made.triangles, "kd")
        inside = np.abs(np.cross(middle.directions, made.view.target - made.view.eye)).max(axis=1) < 0.8
        hits = tree.count_hits(middle.origins[inside], middle.directions[inside])
        assert hits.mean() == pytest.approx(depth, rel=0.4)


def test_published_orders_of_tracers_depend_on_their_times(monkeypatch: pytest.MonkeyPatch) -> None:
    lab = Lab(halfspace_native, quick=True, say=lambda _: None)
    orders = {claim.id: claim for claim in claims_orderings.CLAIMS}

    def verdicts(name: str, seconds: float, build: float) -> set[str]:
        def measured(_lab: Lab, _made: workload.Workload, specs: list[str], _some: Any) -> Any:
            wrong = Errors(rays=8, wrong=1, wrong_triangle=1)
            own, other = claims_orderings.Timed(seconds, build, wrong), claims_orderings.Timed(1.0, 1.0, Errors(rays=8))
            return dict(zip(specs, (own, other), strict=True))

        monkeypatch.setattr(claims_orderings, "measured", measured)
        found = list(orders[name].measure(lab))
        assert all(str(one.checked).startswith("1 of 16 answers") for one in found)
        return {one.verdict for one in found}

    assert verdicts("embree-quality", 0.9, 2.0) == {HOLDS}
    assert verdicts("embree-quality", 0.9, 0.5) == verdicts("embree-quality", 1.1, 2.0) == {FAILS}
    assert verdicts("tinybvh-primary", 0.9, 0.5) == {HOLDS}
    monkeypatch.setattr(yardstick, "MAKERS", {})
    (missing,) = orders["tinybvh-widest"].measure(lab)
    assert (missing.verdict, "--peers" in missing.measured) == (UNTESTED, True)
