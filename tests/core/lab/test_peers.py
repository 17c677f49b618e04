# SPDX-License-Identifier: GPL-3.0-or-later
"""Other ray tracers as rows of the benchmark."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from addon.core.measure import yardstick
from addon.lab.bench import peers
from addon.lab.commands import bench

QUICK = ["--structures", "kd", "--size", "64x64", "--repeats", "1", "--curve", "none", "--only-rays"]

TRACER = """
import numpy as np
from addon.core.base import native

class Built:
    def __init__(self, vertices, triangles):
        self.tree = native.load().build(vertices, triangles, "bvh-sah")

    def closest(self, origins, directions, t_max):
        hits = self.tree.closest(origins, directions, t_max=t_max)
        return {returned}

    def occluded(self, origins, directions, t_max):
        return self.tree.occluded(origins, directions, t_max=t_max)

build = Built
"""


@pytest.fixture(autouse=True)
def _own_makers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(yardstick, "MAKERS", dict(yardstick.MAKERS))


def measured(tmp_path: Path, scenes: list[str], returned: str) -> tuple[int, dict[str, Any]]:
    """The exit status of a benchmark with a tracer of this answer, and the tracer's row."""
    file = tmp_path / "mine.py"
    file.write_text(TRACER.format(returned=returned), encoding="utf-8")
    out = tmp_path / "out"
    status = bench.main([scenes[0], *QUICK, "--peers", str(file), "--out", str(out)])
    rows = json.loads((out / "bench.json").read_text(encoding="utf-8"))["rows"]
    return status, next(row for row in rows if row["spec"] == "peer-mine")


def test_a_python_file_is_a_row(tmp_path: Path, scenes: list[str]) -> None:
    status, row = measured(tmp_path, scenes, "hits.t, hits.triangle, hits.u, hits.v")
    assert status == 0
    assert row["error"] is None
    assert row["errors"]["wrong_triangle"] == row["errors"]["false_miss"] == row["errors"]["false_hit"] == 0
    assert row["rays"]["primary"]["mrays_s"]["med"] > 0
    assert "peer-mine" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_errors_of_a_peer_are_counted_without_a_failure(
    tmp_path: Path, scenes: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    status, row = measured(tmp_path, scenes, "hits.t, np.where(hits.triangle < 0, -1, 0), hits.u, hits.v")
    assert status == 0
    assert row["errors"]["wrong_triangle"] > 0
    assert (
        f"peer-mine, whose arithmetic differs: 0 false misses, 0 false hits, {row['errors']['wrong_triangle']:,}"
        in (" ".join(capsys.readouterr().out.split()))
    )


def test_nonsense_is_the_reason_in_the_row(tmp_path: Path, scenes: list[str]) -> None:
    status, row = measured(tmp_path, scenes, "hits.t[:3], hits.triangle, hits.u, hits.v")
    assert status == 0
    assert row["error"] == "an array of shape (3,) and type float32 is no answer to 4096 rays"


@pytest.mark.parametrize(
    ("text", "reason"), [("raise OSError('no licence')", "no licence"), ("a = 1", "has no function build")]
)
def test_rejects_a_file_without_a_tracer(
    tmp_path: Path, scenes: list[str], capsys: pytest.CaptureFixture[str], text: str, reason: str
) -> None:
    file = tmp_path / "bad.py"
    file.write_text(text, encoding="utf-8")
    assert bench.main([scenes[0], *QUICK, "--peers", str(file)]) == 2
    assert reason in capsys.readouterr().err


def test_tracers_of_the_crate_are_right(tmp_path: Path, scenes: list[str]) -> None:
    built = list(peers.TARGET.glob(f"release/*{peers.MODULE}.*"))
    if not built or shutil.which("cargo") is None:
        pytest.skip("native/peers is not built here: `scripts/bench.py --peers all` builds it")
    out = tmp_path / "out"
    assert bench.main([scenes[0], *QUICK, "--peers", "all", "--out", str(out)]) == 0
    rows = json.loads((out / "bench.json").read_text(encoding="utf-8"))["rows"]
    found = [row for row in rows if row["spec"].startswith(yardstick.PEER)]
    assert len(found) >= 5
    for row in found:
        assert row["error"] is None
        wrong = sum(row["errors"][kind] for kind in ("false_miss", "false_hit", "wrong_triangle", "wrong_any_hit"))
        # Their arithmetic differs, so a ray at an edge may be decided otherwise.
        assert wrong < 0.001 * row["errors"]["rays"], row["spec"]


def test_rejects_two_tracers_of_one_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [tmp_path / folder / "mine.py" for folder in "ab"]
    for file in files:
        file.parent.mkdir()
        file.write_text("build = print", encoding="utf-8")
    assert bench.main([*QUICK, "--peers", ",".join(map(str, files))]) == 2
    assert "two tracers are called mine" in capsys.readouterr().err
