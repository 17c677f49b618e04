# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost maps against the counters of the native module, and the pictures made of them."""

from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.measure import checking, comparing, cost_maps, lettering, map_pictures, workloads
from addon.blender.session import building
from addon.core.base import native
from addon.core.measure import costmap, counting
from addon.core.scene import rays
from addon.core.structures import catalogue
from tests.blender.drawn import row
from tests.blender.shapes import read, with_nodes


@pytest.fixture
def seen(scene: Any) -> Any:
    """Boxes before a camera, in a wide frame."""
    return row(scene, (320, 160))


def test_maps_are_the_counters_of_each_pixel(seen: Any) -> None:
    workload = workloads.current("boxes", (64, 32))
    tree = native.load().build(workload.vertices, workload.triangles, "kd:traversal=dir")
    steps = costmap.measure(tree, workload, (64, 32), "STEPS")
    tests = costmap.measure(tree, workload, (64, 32), "TESTS")
    assert steps.shape == tests.shape == (32, 64)
    # Compute the pixel's ray independently: 39.6 degrees across, square pixels.
    tangent = np.tan(seen.camera.data.angle / 2)
    for line, column in ((3, 5), (16, 10), (17, 40), (16, 60)):
        x, y = ((column + 0.5) / 64 * 2 - 1) * tangent, ((line + 0.5) / 32 * 2 - 1) * tangent / 2
        origin = np.array(seen.camera.location) - read()[0].geometry.origin
        hits = tree.closest(origin[None].astype(np.float32), np.array([[x, y, -1.0]], np.float32), counters=True)
        assert tests[line, column] == hits.counters["tests"][0]
        assert abs(int(steps[line, column]) - int(hits.counters["visits"][0])) <= 1
    assert steps.max() > steps.min() == 0  # rays that pass the scene's box cost nothing
    nanoseconds = costmap.measure(tree, workload, (64, 32), "TIME")
    assert np.isfinite(nanoseconds).all()
    assert (nanoseconds[:8, :8] == nanoseconds[0, 0]).all()


@pytest.mark.parametrize("structure", ["kd:traversal=dir", "octree-beam"])
def test_steps_are_the_visits_of_every_ray(seen: Any, structure: str) -> None:
    workload = workloads.current("boxes", (64, 32))
    tree = native.load().build(workload.vertices, workload.triangles, structure)
    steps = costmap.measure(tree, workload, (64, 32), "STEPS")
    (primary,) = rays.make(workload, tree, size=(64, 32), seed=0, names=("primary",))[:1]
    counters = counting.counters(tree, primary, 0)
    assert steps.sum() == counters["visits"].sum() > counters["steps"].sum()


def test_two_maps_share_one_scale_and_the_bar_shows_it(seen: Any) -> None:
    seen.halfspace.structure = "kd"
    seen.halfspace.second = "brute"
    seen.halfspace.cost = "TESTS"
    assert bpy.ops.halfspace.cost_map(width=64) == {"FINISHED"}
    image = bpy.data.images[cost_maps.IMAGE]
    width, height = image.size
    picture = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(picture)
    picture = picture.reshape(height, width, 4)[..., :3]
    foot = 2 * map_pictures.MARGIN + map_pictures.BAR + int(map_pictures.TEXT * 1.4)
    first = picture[foot : foot + 32, map_pictures.MARGIN : map_pictures.MARGIN + 64]
    second = picture[foot : foot + 32, 2 * map_pictures.MARGIN + 64 : 2 * map_pictures.MARGIN + 128]
    workload = workloads.current("boxes", (64, 32))
    maps = [
        costmap.measure(native.load().build(workload.vertices, workload.triangles, spec), workload, (64, 32), "TESTS")
        for spec in ("kd", "brute")
    ]
    end = costmap.scale_end(maps)
    assert end == 60  # brute force tests all 60 triangles
    for drawn, values in zip((first, second), maps, strict=True):
        assert np.abs(drawn - costmap.coloured(values, end)).max() < 0.01
    bar = picture[foot - map_pictures.MARGIN - 5, map_pictures.MARGIN : width - map_pictures.MARGIN]
    assert np.abs(bar - costmap.coloured(np.linspace(0, end, len(bar)), end)).max() < 0.02
    titles = picture[foot + 32 :]
    assert (np.abs(titles - map_pictures.BACK).max(axis=2) > 0.3).mean() > 0.01
    assert bpy.ops.halfspace.cost_map(width=64) == {"FINISHED"}
    assert [image.name for image in bpy.data.images].count(cost_maps.IMAGE) == 1


def test_a_map_of_times_states_the_number_of_wrong_answers(seen: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from addon.core.measure.reference import Reference

    titles: list[str] = []
    monkeypatch.setattr(map_pictures, "compose", lambda maps, *_: titles.extend(title for title, _ in maps))
    group = seen.halfspace
    group.structure, group.second, group.cost = "kd", "bvh-sah", "TIME"
    cost_maps.draw(seen, 64)
    labels = [catalogue.load()[spec].label for spec in ("kd", "bvh-sah")]
    assert titles == [f"{label}, 0 of 1,024 answers wrong" for label in labels]
    titles.clear()
    monkeypatch.setattr(Reference, "wrong", lambda _self, structure: 3 if structure.spec == "kd" else 0)
    cost_maps.draw(seen, 64)
    assert titles[0] == f"{labels[0]}, 3 of 1,024 answers wrong"
    titles.clear()
    group.cost = "STEPS"
    cost_maps.draw(seen, 64)
    assert titles == labels


def editor(kind: str, image: Any = None) -> Any:
    return SimpleNamespace(type=kind, spaces=SimpleNamespace(active=SimpleNamespace(image=image)))


def test_a_second_map_is_shown_where_the_first_one_is() -> None:
    first = cost_maps.keep(np.zeros((8, 8, 3), np.float32))
    main = SimpleNamespace(screen=SimpleNamespace(areas=[editor("VIEW_3D")]))
    extra = SimpleNamespace(screen=SimpleNamespace(areas=[editor("IMAGE_EDITOR", first)]))
    context = SimpleNamespace(window=main, window_manager=SimpleNamespace(windows=[main, extra]))
    cost_maps.show(context, first)
    # Another image editor of this window does not show the map, and is left alone.
    other = editor("IMAGE_EDITOR", bpy.data.images.new("Other", 4, 4))
    main.screen.areas.append(other)
    cost_maps.show(context, first)
    assert other.spaces.active.image.name == "Other"
    assert extra.screen.areas[0].spaces.active.image == first
    # Without an editor that shows it, that of this window does.
    extra.screen.areas.clear()
    cost_maps.show(context, first)
    assert other.spaces.active.image == first


def test_a_map_of_another_size_replaces_the_first_one_where_it_is_used(scene: Any) -> None:
    material = bpy.data.materials.new("Screen")
    with_nodes(material)
    shows = material.node_tree.nodes.new("ShaderNodeTexImage")
    shows.image = cost_maps.keep(np.zeros((8, 8, 3), np.float32))
    assert cost_maps.keep(np.zeros((4, 6, 3), np.float32)) == shows.image
    assert shows.image.name == cost_maps.IMAGE
    assert tuple(shows.image.size) == (6, 4)


def test_letters_are_written_where_they_belong() -> None:
    picture = np.zeros((40, 120, 3), np.float32)
    lettering.write(picture, [("Hello", 20.0, 12.0)], 16.0, (1.0, 0.5, 0.0))
    ys, xs = np.nonzero(picture[..., 0] > 0.5)
    assert len(xs) > 30
    assert 19 <= xs.min() <= 24
    assert abs(xs.max() - 20 - lettering.width("Hello", 16.0)) <= 3
    assert 10 <= ys.min() <= 14
    assert picture[..., 2].max() == 0


def test_a_scene_without_triangles_is_an_error(scene: Any) -> None:
    with pytest.raises(RuntimeError, match="no triangles"):
        bpy.ops.halfspace.cost_map()


@pytest.mark.parametrize("name", ["cost_map", "check"])
def test_a_build_beyond_its_memory_limit_is_reported(seen: Any, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    def crowded(*_: Any, **__: Any) -> None:
        raise MemoryError("memory_limit: no room")

    monkeypatch.setattr(cost_maps, "draw", crowded)
    monkeypatch.setattr(building, "build_now", crowded)
    with pytest.raises(RuntimeError) as caught:
        getattr(bpy.ops.halfspace, name)()
    assert str(caught.value).strip() == "Error: memory_limit: no room"


def test_scales_end_at_round_numbers() -> None:
    assert costmap.scale_end([np.full((4, 4), 37.0), np.full((4, 4), 3.0)]) == 40
    assert costmap.scale_end([np.zeros((2, 2), np.float32)]) == 1
    assert costmap.scale_end([np.full((2, 2), 0.31)]) == pytest.approx(0.4)
    assert [costmap.number(x) for x in costmap.ticks(40)] == ["0", "10", "20", "30", "40"]
    assert costmap.rounded((100, 3)) == (96, 8)


def test_a_picture_that_is_very_high_is_measured_with_few_rays(seen: Any) -> None:
    seen.render.resolution_x, seen.render.resolution_y = 4, 65536
    width, height = comparing._view(seen)
    assert width * height < 1 << 20
    # A width of 64 pixels would take some hundred million rays.
    picture = cost_maps.draw(seen, 64)
    assert picture.shape[0] * picture.shape[1] < 1 << 24
    assert costmap.shaped(384, (1920, 1080)) == (384, 216)
    assert costmap.shaped(384, (1080, 4320)) == (384, 1536)
    assert costmap.shaped(384, (65536, 4)) == (384, 8)
    assert costmap.shaped(64, (4, 65536)) == (8, 2048)


@pytest.mark.parametrize("width", [8, 12, 64, 100, 384, 1000])
@pytest.mark.parametrize("picture", [(4, 65536), (5, 5000), (1080, 4320), (1080, 4300), (1000, 3980), (65536, 4)])
def test_a_view_has_no_more_rays_than_promised(width: int, picture: tuple[int, int]) -> None:
    wide, high = costmap.shaped(width, picture)
    assert wide % 8 == high % 8 == 0
    assert 0 < wide * high <= costmap.HIGHEST * width * width


@pytest.mark.parametrize("built", [False, True])
@pytest.mark.parametrize("operator", [cost_maps.HALFSPACE_OT_cost_map, checking.HALFSPACE_OT_check])
def test_a_view_other_than_the_camera_s_is_reported(seen: Any, operator: Any, built: bool) -> None:
    seen.camera.data.type = "ORTHO"
    if built:
        building.build_now(seen, bpy.context.evaluated_depsgraph_get())
    reported: list[str] = []
    itself = SimpleNamespace(width=64, report=lambda _kind, line: reported.append(line))
    assert operator.execute(itself, bpy.context) == {"FINISHED"}
    assert [line for line in reported if "No perspective camera" in line]


@pytest.mark.parametrize("width", [60, 120, 320, 1024])
@pytest.mark.parametrize("end", [0.152, 1.0, 12345678.0])
def test_numbers_of_the_scale_do_not_overlap(width: int, end: float) -> None:
    words = sorted(map_pictures._numbers(end, "per ray", width), key=lambda word: word[1])
    ends = [place + lettering.width(text, map_pictures.TEXT) for text, place, _ in words]
    assert words[-1][0].endswith("per ray"), "the end of the scale is always there"
    assert all(end < place for end, (_, place, _) in zip(ends, words[1:], strict=False))
    assert len(words) == 5 or width < 1024
