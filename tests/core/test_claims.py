# SPDX-License-Identifier: GPL-3.0-or-later
"""The claims: every one is measured beside checked answers, and a wrong answer is told."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import claims as command
import halfspace_native
import numpy as np
import pytest
from lying_native import LIES, LyingNative

from addon.core import (
    claims,
    claims_intervals,
    claims_kd,
    claims_report,
    claims_scenes,
    claims_shadows,
    claims_table,
    claims_thesis,
    native,
    results,
    workload,
)
from addon.core.claims import FAILS, HOLDS, UNTESTED, VERDICTS, Claim, Lab, Outcome


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Small pictures and one repeat: what is tested is that all is measured, not how fast it is."""
    monkeypatch.setattr(claims_scenes, "RESOLUTIONS", ((32, 24), (64, 48)))
    monkeypatch.setattr(claims_shadows, "SHADOW_SIZE", (128, 128))
    monkeypatch.setattr(claims_kd, "SIZE", (32, 32))
    monkeypatch.setattr(claims_intervals, "SIZE", (32, 32))
    monkeypatch.setattr(claims, "REPEATS", {True: 1, False: 1})
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
        # The walks of the kd-tree as published have no bounds, and are wrong here and there.
        published = row["claim"].startswith("ta-b") and row["configuration"] == "faithful"
        assert published or row["error"].startswith("0 of ")
        assert not row["error"].startswith("0 of 0 ")
        assert row["why"]
    for claim in claims_table.CLAIMS:
        assert f'id="{claim.id}"' in page
    assert "http" not in page.replace("http://www.w3.org", "").replace("http://purl.org", "").replace(
        "http://creativecommons.org", ""
    ).replace("https://matplotlib.org", "")


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
        told = [line.split(" of ") for line in capsys.readouterr().out.splitlines() if "differ from" in line]
        assert [wrong.strip() for wrong, _ in told] == ["0", "1", "0", "1"], words


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


def test_what_one_claim_found_wrong_is_wrong_for_the_next() -> None:
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
    assert claims_report.summary([result]) == "1 holds, 1 does not hold, 0 cannot be tested here"
