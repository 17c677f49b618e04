# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults around the work: cancels at any moment, renders at once, a full disk, changing input, long use."""

from __future__ import annotations

import gc
import os
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

from addon.core.report import results
from tests import little_room

STRUCTURES = [row["id"] for row in native.structures() if row["id"] != "brute"]
SUN = {"kind": "sun", "to_world": np.eye(4), "power": (3.0, 3.0, 3.0)}
STATM = Path("/proc/self/statm")


def soup(count: int, seed: int = 1) -> tuple[Any, Any]:
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.uniform(-0.1, 0.1, (count, 3, 3))
    return corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def start(structure: Any, size: int = 32, samples: int = 2, threads: int = 1) -> Any:
    place = np.eye(4)
    place[2, 3] = 4.0
    camera = {
        "kind": "perspective",
        "to_world": place,
        "window": (-0.5, 0.5, -0.5, 0.5),
        "clip_start": 0.1,
        "clip_end": 100.0,
    }
    settings = {"width": size, "height": size, "samples": samples, "max_bounces": 2}
    scene = native.RenderScene(structure, lights=[SUN], world={"color": (0.1, 0.2, 0.3)})
    return native.render(scene, camera, settings, threads=threads)


def picture(job: Any) -> bytes:
    assert job.wait(600_000)
    assert job.error is None
    out = np.empty(job.passes["Combined"] * 32 * 32, np.float32)
    job.copy_into("Combined", out)
    return out.tobytes()


def resident() -> int:
    """Bytes of memory that this process holds."""
    gc.collect()
    return int(STATM.read_text(encoding="utf-8").split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.parametrize("spec", STRUCTURES)
def test_a_build_cancelled_at_any_moment_ends_soon(spec: str) -> None:
    scene = soup(30_000)
    for delay in np.random.default_rng(len(spec)).uniform(0.0, 0.05, 4):
        monitor = native.Monitor()
        timer = threading.Timer(delay, monitor.cancel)
        timer.start()
        try:
            with suppress(native.Cancelled):
                native.build(*scene, spec, monitor=monitor, threads=2)
        finally:
            timer.cancel()
            timer.join()
    # The next build knows nothing of it.
    assert native.build(*soup(50), spec).validate() == []


def test_a_render_cancelled_at_any_moment_ends_soon() -> None:
    structure = native.build(*soup(500), "kd")
    for delay in np.random.default_rng(5).uniform(0.0, 0.05, 8):
        job = start(structure, size=256, samples=4096, threads=2)
        time.sleep(delay)
        job.cancel()
        assert job.wait(300_000)
        assert job.cancelled
        assert job.error is None
        del job
    assert picture(start(structure)) == picture(start(structure))


def test_renders_at_once_give_the_pictures_they_give_alone() -> None:
    structures = [native.build(*soup(300, seed), spec) for seed, spec in enumerate(STRUCTURES)]
    alone = [picture(start(structure)) for structure in structures]
    jobs = [start(structure, threads=2) for structure in structures]
    assert [picture(job) for job in jobs] == alone
    # Of one structure, too.
    same = [start(structures[0], threads=1 + i % 2) for i in range(4)]
    assert {picture(job) for job in same} == {alone[0]}


def test_a_scene_that_changes_meanwhile_changes_no_picture() -> None:
    vertices, triangles = soup(300)
    before = picture(start(native.build(vertices, triangles, "kd")))
    job = start(native.build(vertices, triangles, "kd"))
    vertices[:] = np.nan
    triangles[:] = 0
    assert picture(job) == before


def test_rays_that_change_meanwhile_do_no_harm() -> None:
    structure = native.build(*soup(300), "kd")
    origins = np.random.default_rng(2).uniform(-2, 2, (200_000, 3)).astype(np.float32)
    directions = -origins
    stop = threading.Event()

    def disturb() -> None:
        while not stop.is_set():
            directions[::7] = np.nan
            directions[::5] = 0.0
            directions[::3] = np.inf

    thread = threading.Thread(target=disturb)
    thread.start()
    try:
        for _ in range(3):
            try:
                hits = structure.closest(origins, directions, threads=2)
            except native.NonFiniteError:
                continue
            assert len(hits) == len(origins)
    finally:
        stop.set()
        thread.join()


@pytest.mark.skipif(not STATM.exists(), reason="this system does not tell how much memory a process holds")
def test_an_animation_holds_its_memory_and_repeats_itself() -> None:
    # Enough that one frame in three which is not given back, tree and all, would show.
    vertices, triangles = soup(700)

    def frame(number: int) -> bytes:
        moved = vertices * np.float32(1 + 0.01 * number)
        return picture(start(native.build(moved, triangles, STRUCTURES[number % len(STRUCTURES)]), samples=1))

    frames = 3 * len(STRUCTURES)
    first = [frame(number) for number in range(frames)]
    held = resident()
    for _ in range(3):
        assert [frame(number) for number in range(frames)] == first
    assert resident() - held < 8 << 20
    assert len(set(first)) == frames


def test_a_full_disk_keeps_the_old_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fsync(_handle: int) -> None:
        raise OSError(28, "No space left on device")

    path = tmp_path / "report.html"
    results.write(path, "old")
    monkeypatch.setattr(os, "fsync", fsync)
    with pytest.raises(results.FolderError, match=r"report\.html: cannot be written: No space"):
        results.write(path, "new, and half of it lost")
    assert path.read_text(encoding="utf-8") == "old"
    assert list(tmp_path.iterdir()) == [path]


BENCH = "bench grid --structures kd --size 8x8 --repeats 1 --check-rays 64 --seconds 1 --rays primary --only-rays"
BENCH += " --curve none --out HERE"


@pytest.mark.parametrize(
    ("room", "command", "kept"),
    [
        (64, BENCH, {"rows.jsonl"}),
        (4000, BENCH, {"rows.jsonl", "bench.json", "bench.csv"}),
        (4000, f"{BENCH} --export latex", {"rows.jsonl", "bench.json", "bench.csv"}),
        (64, "stability --structures bih:shadow=none --scenes grid --rays 64 --out HERE", {"rows.jsonl"}),
        (64, "claims ta-b-singularities --out HERE", {"rows.jsonl"}),
        (64, "export grid --out HERE/tree.npz", {"tree.npz"}),
    ],
)
def test_a_command_on_a_full_disk_says_so_in_one_line(tmp_path: Path, room: int, command: str, kept: set[str]) -> None:
    pytest.importorskip("resource", reason="this system limits no file's size")
    if "tree.npz" in kept:
        (tmp_path / "tree.npz").write_bytes(b"old")
    name, *words = command.replace("HERE", str(tmp_path)).split()
    done = little_room.run(room, name, words)
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert str(tmp_path) in done.stderr.splitlines()[-1]
    assert "cannot be written" in done.stderr.splitlines()[-1]
    # What is there is whole.
    assert {path.name for path in tmp_path.iterdir()} <= kept
    assert "tree.npz" not in kept or (tmp_path / "tree.npz").read_bytes() == b"old"
