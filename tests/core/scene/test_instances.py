# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes in places: the same answers and pictures as flattened, and only what changed is built again."""

from __future__ import annotations

import dataclasses
import itertools
import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

from addon.core.measure import benchmark
from addon.core.report import tables
from addon.core.scene import workload
from addon.core.scene.instances import TOPS, InstancedGeometry, Mesh, choose
from addon.core.scene.scene import Camera, Material, Scene, World
from addon.core.session import session
from addon.core.session.session import Session
from addon.core.structures.settings import RenderSettings
from addon.core.structures.trees import Trees


def ball(rings: int, *, smooth: bool = True, slots: bool = False) -> Mesh:
    """A bumpy ball."""
    sectors = 2 * rings
    theta, phi = np.meshgrid(np.linspace(0, np.pi, rings + 1), np.arange(sectors) * 2 * np.pi / sectors, indexing="ij")
    normals = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1).reshape(-1, 3)
    vertices = (normals * (1 + 0.1 * np.sin(3 * phi.reshape(-1, 1)))).astype(np.float32)
    i, j = (x.reshape(-1) for x in np.meshgrid(np.arange(rings), np.arange(sectors), indexing="ij"))
    after = (j + 1) % sectors
    at = [i * sectors + j, (i + 1) * sectors + j, (i + 1) * sectors + after, i * sectors + after]
    triangles = np.concatenate([np.stack([at[0], at[k], at[k + 1]], -1) for k in (1, 2)]).astype(np.int32)
    return Mesh(
        vertices,
        triangles,
        (np.arange(len(triangles)) % 3).astype(np.int32) if slots else None,
        normals.astype(np.float32)[triangles] if smooth else None,
    )


def turned(rng: Any, scale: Any) -> Any:
    linear, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return linear * scale


def places(meshes: tuple[Mesh, ...], count: int, seed: int = 3, spread: float = 4.0) -> InstancedGeometry:
    """Turned, some mirrored, some unevenly scaled."""
    rng = np.random.default_rng(seed)
    matrices = np.tile(np.eye(4), (count, 1, 1))
    for i, matrix in enumerate(matrices):
        matrix[:3, :3] = turned(rng, (1.0, 0.3, (-1.0, 1.0, 1.0), (0.5, 1.0, 1.7))[i % 4])
        matrix[:3, 3] = rng.uniform(-spread, spread, 3)
    inverse = np.linalg.inv(matrices[:, :3, :3])
    inverse /= np.linalg.norm(inverse, axis=1).max(axis=1)[:, None, None]
    return InstancedGeometry(
        meshes=meshes,
        mesh=(np.arange(count) % len(meshes)).astype(np.int32),
        matrices=matrices,
        names=tuple(f"Ball {i}" for i in range(count)),
        materials=np.stack([np.arange(count) % 3, (np.arange(count) + 1) % 3], -1).reshape(-1).astype(np.int32),
        first_material=2 * np.arange(count + 1, dtype=np.int32),
        normal_matrices=np.ascontiguousarray(inverse.transpose(0, 2, 1), np.float32),
        keeps_length=(np.arange(count) % 4 != 3).astype(np.bool_),
    )


def scene(geometry: Any) -> Scene:
    materials = (
        Material("Matte", (0.8, 0.5, 0.3)),
        Material("Metal", metallic=1.0, roughness=0.2),
        Material("Glass", transmission=1.0, roughness=0.0),
    )
    return Scene(geometry, materials, (), World((1.0, 1.0, 1.0)))


ABOVE = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 14], [0, 0, 0, 1]])
CAMERA = Camera("perspective", ABOVE, (-0.4, 0.4, -0.3, 0.3), 0.1, 1e3)


def picture(session: Session, size: tuple[int, int] = (48, 36)) -> Any:
    settings = RenderSettings(*size, samples=2, max_bounces=4, passes=("Combined", "Normal", "Position"))
    job = session.render(CAMERA, settings)
    assert job.wait(600_000)
    assert job.error is None
    out = {}
    for name, channels in job.passes.items():
        out[name] = np.empty(size[0] * size[1] * channels, np.float32)
        job.copy_into(name, out[name])
    return out


def start(geometry: Any, spec: str = "kd", trees: Trees | None = None) -> Session:
    return Session.start(native, scene(geometry), spec, trees=trees or Trees(), keep_going=lambda _: True)


def same(a: dict[str, Any], b: dict[str, Any]) -> bool:
    return all(np.array_equal(a[name].view(np.uint32), b[name].view(np.uint32)) for name in a)


@pytest.mark.parametrize("top", TOPS)
def test_the_tree_over_the_instances_is_the_chosen_one(top: str) -> None:
    geometry = places((ball(4), ball(3)), 9)
    other = dataclasses.replace(geometry, top=top)
    assert geometry.same_triangles(other) == (geometry.top == top)
    one = start(other)
    assert one.statistics["top"] == top
    assert same(picture(start(geometry)), picture(one))


def test_a_scene_at_another_time_shares_what_does_not_differ() -> None:
    geometry = places((ball(4, slots=True), ball(3)), 9)
    matrices = geometry.matrices.copy()
    matrices[:, :3, 3] += 0.25
    # A background that lights through a medium, and no surface beyond the first.
    thin = {"closures": [{"scattering": 0.01, "absorption": 0.02}]}
    world = World((1.0, 1.0, 1.0), volume=thin, max_bounces=0, casts_shadow=False)
    still = dataclasses.replace(scene(geometry), world=world)
    later = dataclasses.replace(still, geometry=dataclasses.replace(geometry, matrices=matrices))
    first, alone = start(geometry), start(later.geometry)
    first.show(still)
    shown = still, first.render_scene
    given = session._later(later, shown)
    assert not {"materials", "images", "layers", "world", "indices"} & given.keys()
    assert "meshes" not in given["surfaces"]
    alone.show(later)
    one = picture(alone)
    assert not same(one, picture(first))
    alone.show(later, shown)
    assert same(one, picture(alone))
    # What differs is not that of the first.
    alone.show(dataclasses.replace(later, world=World((1.0, 0.0, 0.0))), shown)
    colours = picture(alone)["Combined"].reshape(-1, 4)
    assert colours[:, 0].any()
    assert not colours[:, 1:3].any()
    surfaces = {name: value for name, value in geometry.surfaces().items() if name != "meshes"}
    with pytest.raises(native.ShapeError, match="meshes"):
        native.RenderScene(alone.structure, surfaces=surfaces)


def expected_surfaces(geometry: InstancedGeometry, vertices: Any, triangles: Any) -> dict[str, Any]:
    """Material and corner normals of every flattened triangle, the slow and plain way."""
    material, normals = [], []
    start = 0
    for i, number in enumerate(geometry.mesh):
        mesh, count = geometry.meshes[number], len(geometry.meshes[number].triangles)
        own = geometry.materials[geometry.first_material[i] : geometry.first_material[i + 1]]
        slots = np.zeros(count, int) if mesh.slots is None else np.minimum(mesh.slots, len(own) - 1)
        material.append(own[slots])
        if mesh.corner_normals is None:
            a, b, c = (vertices[triangles[start : start + count, k]].astype(np.float64) for k in range(3))
            turned_normals = np.cross(b - a, c - a)[:, None, :].repeat(3, axis=1)
            lengths = np.sqrt((turned_normals[..., 0] ** 2 + turned_normals[..., 1] ** 2) + turned_normals[..., 2] ** 2)
            turned_normals = (turned_normals / lengths[..., None]).astype(np.float32)
        else:
            x, y, z = (mesh.corner_normals[..., k, None] for k in range(3))
            rows = geometry.normal_matrices[i]
            turned_normals = (x * rows[:, 0] + y * rows[:, 1]) + z * rows[:, 2]
            if not geometry.keeps_length[i]:
                u, v, w = (turned_normals[..., k] for k in range(3))
                turned_normals = turned_normals / np.sqrt((u * u + v * v) + w * w)[..., None]
            if np.linalg.det(geometry.matrices[i, :3, :3]) < 0:
                turned_normals = turned_normals[:, [0, 2, 1]]
        normals.append(turned_normals)
        start += count
    return {
        "material_index": np.concatenate(material).astype(np.int32),
        "corner_normals": np.ascontiguousarray(np.concatenate(normals), np.float32),
    }


@pytest.mark.parametrize("spec", ["kd", "bvh-sah", "bsp-wn-plus-kd", "octree-net"])
def test_pictures_are_those_of_the_flattened_scene(spec: str) -> None:
    geometry = places((ball(5, slots=True), ball(4, smooth=False), ball(3)), 14)
    session = start(geometry, spec)
    vertices, triangles = session.structure.flattened()
    flat_scene = native.RenderScene(
        native.build(vertices, triangles, "kd"),
        **expected_surfaces(geometry, vertices, triangles),
        materials=[vars(material) for material in scene(geometry).materials],
        world={"color": (1.0, 1.0, 1.0)},
    )
    flat = Session(native, geometry, spec, structure=session.structure)
    flat.render_scene = flat_scene
    one, other = picture(session), picture(flat)
    assert same(one, other)
    assert session.left_out == flat.left_out
    assert one["Normal"].any()


def test_the_build_includes_that_of_the_meshes(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = itertools.count(0.0, 100.0)
    monkeypatch.setattr(session, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
    assert 100 <= start(places((ball(3),), 2)).statistics["build_seconds"] < 200


def test_meshes_of_equal_triangles_keep_their_own_materials() -> None:
    mesh = ball(5)
    flat = Mesh(mesh.vertices, mesh.triangles, None, None)
    kept = places((mesh, flat), 8)
    assert start(kept, trees=Trees()).meshes_built == 1
    assert not same(picture(start(kept)), picture(start(places((mesh, mesh), 8))))


def test_only_what_changed_is_built_again() -> None:
    meshes = (ball(5), ball(4), ball(3))
    trees = Trees()
    first = start(places(meshes, 9), trees=trees)
    assert first.meshes_built == 3
    # Everything moves: no tree is built.
    moved = start(places(meshes, 9, seed=4), trees=trees)
    assert moved.meshes_built == 0
    assert same(picture(moved), picture(start(places(meshes, 9, seed=4))))
    assert not same(picture(moved), picture(first))
    # One mesh changes, here by one vertex: one tree is.
    vertices = meshes[1].vertices.copy()
    vertices[7] *= 1.5
    edited = places((meshes[0], Mesh(vertices, meshes[1].triangles, None, meshes[1].corner_normals), meshes[2]), 9)
    session = start(edited, trees=trees)
    assert session.meshes_built == 1
    assert same(picture(session), picture(start(edited)))
    # Another structure is another tree, and nothing is kept that nobody uses.
    for spec, count in (("bvh-sah", 3), ("bvh-sah", 3), ("kd", 0)):
        assert start(edited, spec, trees=trees).meshes_built == count


def test_bad_places_are_dropped_by_number() -> None:
    structure = native.build(ball(4).vertices, ball(4).triangles)
    matrices = np.tile(np.eye(4), (6, 1, 1))
    matrices[0, 1, 1] = 0
    matrices[5, :3, :3] = [[1, 2, 3], [4, 5, 6], [5, 7, 9]]
    matrices[2, 0, 3] = np.nan
    matrices[3, :3, :3] *= 1e-80
    placed = native.build_instances([structure], np.zeros(6, np.int32), matrices)
    assert placed.statistics["dropped_instances"] == [0, 2, 3, 5]
    hits = placed.closest(np.array([[0.1, 0.2, 5]], np.float32), np.array([[0, 0, -1]], np.float32))
    assert hits.triangle[0] // len(ball(4).triangles) == 1
    empty = native.build_instances([], np.zeros(0, np.int32), np.zeros((0, 4, 4)))
    assert len(empty) == 0
    assert empty.closest(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32)).triangle[0] == -1
    assert picture(start(places((), 0)))["Combined"].any()


def test_rejects_wrong_arguments() -> None:
    structure = native.build(ball(40).vertices, ball(40).triangles)
    one = np.eye(4)[None]
    count = (1 << 31) // len(ball(40).triangles) + 1
    for mesh, matrices, words in (
        (np.ones(1, np.int32), one, r"mesh\[0\]: 1 is out of range for 1 meshes"),
        (np.zeros(2, np.int32), one, "matrices: expected one per instance, 2"),
        (np.zeros(1, np.int32), np.eye(3)[None], r"matrices: expected a \(k, 4, 4\)"),
        (np.zeros(count, np.int32), np.broadcast_to(np.eye(4), (count, 4, 4)), "at most 2147483646 triangles"),
    ):
        with pytest.raises(native.ShapeError, match=words):
            native.build_instances([structure], mesh, matrices)
    placed = native.build_instances([structure], np.zeros(1, np.int32), one)
    with pytest.raises(native.ShapeError, match="surfaces"):
        native.RenderScene(placed, surfaces=places((ball(40),), 2).surfaces(), materials=[{}] * 3)


def test_the_choice_follows_memory() -> None:
    forest, room = [(10_000, 100_000)], [(50_000, 1), (20_000, 1)]
    chosen = choose("auto", forest, numbers=3, interactive=False)
    assert chosen.two_level
    assert "saves" in chosen.reason
    assert not choose("auto", room, numbers=3, interactive=False).two_level
    assert not choose("flatten", forest, numbers=3, interactive=True).two_level
    assert choose("two-level", room, numbers=3, interactive=False).two_level
    # Without instances there is nothing to say, except that two levels were asked for.
    for mode in ("auto", "flatten"):
        assert choose(mode, room, numbers=3, interactive=False).reason == ""
    assert choose("flatten", [(50_000, 2)], numbers=3, interactive=False).reason.startswith("instances: flattened")
    large = [(80_000, 1), (60_000, 1)]
    assert choose("auto", large, numbers=0, interactive=True).two_level
    assert not choose("auto", [], numbers=0, interactive=True).two_level


MEMORY = """
import resource, sys
import numpy as np
from tests.core.scene.test_instances import Mesh, ball, picture, places, start
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
geometry = places((ball(50),), {count}, spread=400.0)
session = start(geometry)
picture(session)
print(geometry.count, before * 1024, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
"""


def test_many_instances_take_little_memory() -> None:
    pytest.importorskip("resource", reason="this system does not tell how much memory a process held at most")
    # A hundredth of 10^5 instances of 10^4 triangles; flattened its vertices and indices alone would take 180 MB.
    script = [sys.executable, "-c", MEMORY.format(count=1000)]
    done = subprocess.run(script, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    count, before, peak = map(int, done.stdout.split())
    assert count == 1000 * 10_000
    assert peak - before < 60 << 20, f"{(peak - before) >> 20} MiB"


@pytest.mark.parametrize("top", TOPS)
def test_structures_in_two_levels_are_measured_and_compared_with_brute_force(top: str) -> None:
    kept = places((ball(6), ball(4)), 9)
    structures = [native.build(mesh.vertices, mesh.triangles, "kd") for mesh in kept.meshes]
    vertices, triangles = native.build_instances(structures, kept.mesh, kept.matrices).flattened()
    view = workload.framing_view(vertices, triangles)
    balls = workload.Workload("balls", vertices, triangles, view, kept=scene(kept))
    options = benchmark.Options(size=(32, 32), repeats=1, check_rays=512, layout="two-level", top=top)
    rows = list(benchmark.measure(native, balls, ["brute", "kd", "bvh-sah"], options, lambda _: None))
    assert sorted(row["spec"] for row in rows) == ["brute", "bvh-sah", "kd"]
    for row in rows:
        assert row["error"] is None
        assert benchmark.agrees(row)
        assert row["errors"]["reference"] == "brute"
        assert row["statistics"]["instances"] == 9
        assert {way["rays"] for way in (row["ways"] or {}).values()} == {"single"}
        assert all(len(one["rounds"]) == 1 and one["hits"] > 0 for one in row["rays"].values())
        assert row["statistics"]["top"] == top
    assert f"two levels, the upper one by {top}" in tables.measured("balls", rows)[0]
    # A flattened scene has no levels to measure.
    with pytest.raises(workload.WorkloadError, match="balls: two levels need instances"):
        benchmark.prepared(native, dataclasses.replace(balls, kept=None), options)
    with pytest.raises(native.SpecError, match="top: expected one of sah, grid, middle, median, got kd"):
        native.build_instances(structures, kept.mesh, kept.matrices, top="kd")
