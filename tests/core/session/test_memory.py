# SPDX-License-Identifier: GPL-3.0-or-later
"""Work that needs more memory than there is ends with an error, before the system ends the process."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

from addon.core.base import native as loading
from addon.core.base import room
from addon.core.measure import benchmark, peak, preparation
from addon.core.scene import grid, rays, workload
from addon.core.scene.workload import WorkloadError
from addon.lab.commands import bench
from tests.kinds import KINDS
from tests.lying_native import altered
from tests.one_line import told
from tests.render_scenes import camera

SOUP = np.random.default_rng(4).normal(size=(9000, 3)).astype(np.float32)
INDICES = np.arange(9000, dtype=np.int32).reshape(-1, 3)
ENDLESS = 1 << 45
"""More rows than any machine holds; as a broadcast array they take no memory themselves."""


@pytest.mark.parametrize("spec", KINDS)
def test_a_build_beyond_its_limit_is_refused_and_one_within_is_not(spec: str) -> None:
    with pytest.raises(MemoryError, match="memory_limit: the build needs more than the 1 MB"):
        native.build(SOUP, INDICES, spec, memory_limit=200_000)
    native.build(SOUP, INDICES, spec, memory_limit=100_000_000)


def test_a_tree_is_stopped_while_it_grows() -> None:
    # Needles across the whole scene: each lies in many cells.
    ends = np.random.default_rng(5).normal(size=(6000, 2, 3))
    needles = np.concatenate([ends, ends[:, :1] + 1e-3], axis=1).astype(np.float32).reshape(-1, 3)
    triangles = np.arange(len(needles), dtype=np.int32).reshape(-1, 3)
    limit = 8_000_000
    native.build(needles, triangles, "bvh-sah", memory_limit=limit)
    monitor = native.Monitor()
    with pytest.raises(MemoryError, match="needs more than the 8 MB"):
        native.build(needles, triangles, "kd-sah", memory_limit=limit, monitor=monitor)
    # The monitor can serve another build.
    native.build(SOUP, INDICES, "kd", memory_limit=limit, monitor=monitor)


@pytest.mark.parametrize("spec", ["bbox-gs", "bbox-gs-bnb"])
def test_a_tree_that_grows_triangle_by_triangle_is_stopped_too(spec: str) -> None:
    # Enough for the triangles, not for the nodes.
    with pytest.raises(MemoryError, match="memory_limit: the build needs more than the 1 MB"):
        native.build(SOUP, INDICES, spec, memory_limit=450_000)


def test_a_peak_is_measured_under_the_limit_that_was_asked_for() -> None:
    scene = peak.save_scene(SOUP, INDICES)
    try:
        measurements = [peak.Measurement(native, scene, "kd", 1, memory_limit=limit) for limit in (200_000, None)]
        refused, allowed = measurements
        while not all(measurement.wait(0.05) for measurement in measurements):
            pass
        with pytest.raises(peak.PeakError, match="memory_limit: the build needs more than the 1 MB"):
            refused.result()
        assert allowed.result() > 0
    finally:
        scene.unlink()


def test_a_limit_is_a_number_of_bytes() -> None:
    with pytest.raises(native.SpecError, match="memory_limit"):
        native.build(SOUP, INDICES, memory_limit=-1)
    assert native.free_memory() > 1 << 20


def endless(dtype: str) -> Any:
    return np.broadcast_to(np.ones(3, dtype), (ENDLESS, 3))


NORMALS = np.broadcast_to(np.float32(1), (ENDLESS, 3, 3))


@pytest.mark.parametrize(
    ("name", "work"),
    [
        ("vertices", lambda: native.build(endless("f4"), INDICES)),
        ("vertices", lambda: native.build(endless("f8"), INDICES)),
        ("triangles", lambda: native.build(SOUP, endless("i4"))),
        ("triangles", lambda: native.build(SOUP, endless("i8"))),
        ("origins", lambda: native.build(SOUP, INDICES).closest(endless("f4"), SOUP)),
        ("directions", lambda: native.build(SOUP, INDICES).occluded(SOUP, endless("f8"))),
        ("t_max", lambda: native.build(SOUP, INDICES).closest(SOUP, SOUP, 0.0, endless("f4")[:, 0])),
        ("material_index", lambda: native.RenderScene(native.build(SOUP, INDICES), material_index=endless("i4")[:, 0])),
        ("corner_normals", lambda: native.RenderScene(native.build(SOUP, INDICES), corner_normals=NORMALS)),
    ],
)
def test_an_array_larger_than_memory_is_refused_by_name(name: str, work: Any) -> None:
    with pytest.raises(MemoryError, match=rf"^{name}: needs \d+ MB"):
        work()


def test_a_film_larger_than_memory_is_refused() -> None:
    scene = native.RenderScene(native.build(SOUP, INDICES))
    passes = ["Combined", "Depth", "Normal", "Position"]
    settings = {"width": 1 << 15, "height": 1 << 15, "samples": 1, "passes": passes}
    if native.free_memory() > (1 << 30) * 11 * 8:
        pytest.skip("this machine has room for the largest film")
    with pytest.raises(MemoryError, match="film"):
        native.render(scene, camera(), settings)


NARROW = altered(free_memory=lambda: 1_000_000_000)
"""The module on a machine with a gigabyte of free memory."""

NO_ROOM = r"^the rays of 16384x16384 pixels: needs about \d+ MB, of 1000 MB that are free$"


@pytest.mark.parametrize("names", [("primary",), rays.NAMES])
def test_rays_that_are_larger_than_memory_are_refused_before_they_are_made(
    names: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rays, "make", lambda *_, **__: pytest.fail("rays were made"))
    options = benchmark.Options(size=(1 << 14, 1 << 14), sets=names)
    with pytest.raises(MemoryError, match=NO_ROOM):
        preparation.prepared(NARROW, grid.workload(rays=64), options)


def test_a_size_without_room_is_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(loading, "load", lambda: NARROW)
    monkeypatch.setattr(rays, "make", lambda *_, **__: pytest.fail("rays were made"))
    said = told(bench, ["grid", "--structures", "kd", "--size", "16384x16384"], capsys)
    assert re.fullmatch(NO_ROOM.strip("^$"), said.removeprefix("bench: grid: ").rstrip())


def test_a_report_of_rows_that_are_there_needs_no_room_for_rays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = ["grid", "--structures", "kd", "--size", "64x64", "--repeats", "1", "--rays", "primary"]
    asked += ["--curve", "none", "--check-rays", "64", "--seconds", "1", "--only-rays", "--out", str(tmp_path)]
    assert bench.main(asked) == 0
    (tmp_path / "report.html").unlink()
    monkeypatch.setattr(room, "SMALL", 0)
    monkeypatch.setattr(loading, "load", lambda: altered(free_memory=lambda: 0))
    assert bench.main(asked) == 0
    assert (tmp_path / "report.html").is_file()


def test_a_benchmark_goes_on_without_the_structure_that_is_too_large() -> None:
    limits: set[int | None] = set()

    def build(vertices: Any, triangles: Any, spec: str, **options: Any) -> Any:
        # A configuration is read by a build of one triangle, which needs no limit.
        if len(triangles) > 1 and spec in ("kd", "bvh-sah"):
            limits.add(options.get("memory_limit"))
        return native.build(vertices, triangles, spec, **options)

    room, watched = grid.workload(rays=64), altered(build=build)
    options = benchmark.Options(size=(8, 8), sets=("primary",), repeats=1, check_rays=64, memory_limit=450_000)
    rows = {row["spec"]: row for row in benchmark.measure(watched, room, ["kd", "bvh-sah"], options, lambda _: None)}
    assert rows["kd"]["error"].startswith("memory_limit: the build needs more than the 1 MB")
    assert rows["bvh-sah"]["error"] is None
    # The builds that make the rays have the same limit.
    assert limits == {450_000}
    with pytest.raises(MemoryError, match="memory_limit"):
        list(benchmark.measure(native, room, ["bih"], replace(options, memory_limit=1000), lambda _: None))


def test_a_file_that_unpacks_to_more_than_memory_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bomb.npz"
    np.savez_compressed(path, vertices=np.zeros((1 << 20, 3), np.float32), triangles=np.zeros((1, 3), np.int32))
    assert path.stat().st_size < 1 << 17
    with pytest.raises(WorkloadError, match=r"bomb.npz: needs .* bytes of memory"):
        workload.load_npz(path, memory_limit=1 << 20)
    with pytest.raises(WorkloadError, match="is missing"):
        workload.load_npz(path, memory_limit=1 << 30)
