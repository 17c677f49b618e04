# SPDX-License-Identifier: GPL-3.0-or-later
"""A process with little address space left (`ulimit -v`) gets an error at each stage, and goes on."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/proc/self/limits").is_file(), reason="this system lists no limits"),
]

PROGRAM = """
import resource
import numpy as np
import halfspace_native as native

def limited(megabytes):
    text = open("/proc/self/status", encoding="utf-8").read()
    used = int(text.partition("VmSize:")[2].split()[0]) << 10
    resource.setrlimit(resource.RLIMIT_AS, (used + (megabytes << 20), resource.RLIM_INFINITY))

def refused(work):
    try:
        work()
    except MemoryError as error:
        return str(error)
    raise SystemExit("not refused")

camera = {"kind": "perspective", "to_world": np.eye(4), "window": (-1.0, 1.0, -1.0, 1.0)}
camera |= {"clip_start": 0.1, "clip_end": 10.0}
settings = {"width": 4096, "height": 4096, "samples": 1, "passes": ["Combined", "Normal", "Position"]}
vertices = np.random.default_rng(1).random((3 * COUNT, 3), np.float32)
triangles = np.arange(3 * COUNT, dtype=np.int32).reshape(-1, 3)
small = native.build(vertices[:300], triangles[:100], "kd", threads=1)
origins = np.broadcast_to(vertices[:1], (12_000_000, 3))
scene = native.RenderScene(small)
limited(ROOM)
print(refused(lambda: WORK))
# The process goes on.
hits = small.closest(vertices[:100], vertices[100:200] - vertices[:100], threads=1)
print(len(hits))
"""


def run(work: str, *, room: int, count: int = 1000) -> tuple[int, list[str], str]:
    """Exit status, printed lines and errors of the work with this number of megabytes left."""
    program = PROGRAM.replace("WORK", work).replace("ROOM", str(room)).replace("COUNT", str(count))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=550, env=environment, check=False
    )
    return done.returncode, done.stdout.splitlines(), done.stderr


@pytest.mark.parametrize(
    ("work", "count", "room", "said"),
    [
        ("native.build(vertices, triangles, 'kd', threads=1)", 1_000_000, 100, "memory_limit: the build needs "),
        ("native.build(vertices, triangles, 'bvh-sah', threads=1)", 1_000_000, 40, "memory_limit: the build needs "),
        ("small.closest(origins, origins, threads=1)", 1000, 150, "origins: needs "),
        ("native.render(scene, camera, settings, threads=1)", 1000, 200, "settings: the film: needs "),
    ],
    ids=["build", "objects", "rays", "film"],
)
def test_rejects_work_that_does_not_fit(work: str, count: int, room: int, said: str) -> None:
    status, lines, errors = run(work, room=room, count=count)
    assert (status, errors) == (0, "")
    assert lines[0].startswith(said)
    assert lines[1] == "100"


def test_free_memory_counts_the_limit() -> None:
    work = "(_ for _ in ()).throw(MemoryError(str(native.free_memory())))"
    status, lines, _ = run(work, room=160)
    assert status == 0
    # Seven eighths of it, without what NumPy took meanwhile.
    assert 100 << 20 < int(lines[0]) <= 140 << 20


BENCH = """
import resource, runpy, sys
resource.setrlimit(resource.RLIMIT_AS, ({room}, {room}))
sys.argv = [{script!r}, *{arguments!r}]
runpy.run_path({script!r}, run_name="__main__")
"""

SHORT = ["grid", "--structures", "kd", "--size", "64x64", "--repeats", "1", "--check-rays", "64", "--seconds", "1"]
SHORT += ["--rays", "primary", "--curve", "none", "--only-rays", "--out"]


@pytest.mark.parametrize("megabytes", [220, 300, 340, 380, 420, 600])
def test_a_benchmark_in_little_memory_is_whole_or_ends_in_one_line(megabytes: int, tmp_path: Path) -> None:
    """Which stage lacks memory depends on the machine. Embree would end the process, and is left out in time."""
    script = str(Path(__file__).resolve().parents[3] / "scripts" / "bench.py")
    program = BENCH.format(room=megabytes << 20, script=script, arguments=[*SHORT, str(tmp_path)])
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=550, env=environment, check=False
    )
    assert "Traceback" not in done.stderr
    if done.returncode == 1 and "OpenBLAS error: Memory allocation" in done.stderr:
        pytest.skip("NumPy's library ended the process, with a line of its own, where its buffer did not fit")
    assert done.returncode in (0, 2), done.stderr
    # Rows whose structures do not fit are in the report, with the reason.
    if not (tmp_path / "report.html").is_file():
        assert done.returncode == 2
        assert done.stderr.splitlines()[-1].startswith("bench: ")
