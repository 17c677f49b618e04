# SPDX-License-Identifier: GPL-3.0-or-later
"""The overlay drawn offscreen, against polygons that are projected here on their own way to the picture."""

from __future__ import annotations

import gc
import weakref
from pathlib import Path
from types import MethodType, SimpleNamespace
from typing import Any

import bpy
import gpu
import numpy as np
import overlay_picture
import pytest
from mathutils import Euler, Matrix, Vector
from shapes import cube, grid

from addon.blender import building, overlay, picking, pictures, properties, trees
from addon.core import beams, catalogue, colours, native, planes

WIDTH, HEIGHT = 200, 150


def some_triangles() -> tuple[Any, Any]:
    """Corners and triangles, tilted."""
    rng = np.random.default_rng(3)
    corners = (rng.random((40, 1, 3)) * 4 + 0.4 * rng.standard_normal((40, 3, 3))).astype(np.float32)
    return corners.reshape(-1, 3), np.arange(120, dtype=np.int32).reshape(-1, 3)


def representatives() -> list[str]:
    """One structure for each way of looking: the kinds of planes that it draws over a few tilted triangles."""
    if native.problem() is not None:
        return []
    chosen: dict[frozenset[int], str] = {}
    for structure in catalogue.load().structures:
        tree = native.load().build(*some_triangles(), structure.id)
        chosen.setdefault(frozenset(tree.split_polygons()["kind"].tolist()), structure.id)
    return list(chosen.values())


STRUCTURES = representatives()


@pytest.fixture
def canvas() -> Any:
    if not hasattr(gpu, "init"):
        pytest.skip("this Blender cannot draw without a window (gpu.init came with 5.2)")
    try:
        gpu.init()
    except Exception as error:
        pytest.skip(f"no drawing here: {error}")
    return gpu.types.GPUOffScreen(WIDTH, HEIGHT, format="RGBA16F")


def boxes(add: Any, offset: tuple[float, float, float] = (0, 0, 0)) -> None:
    """Boxes of several sizes, parallel to the axes."""
    for i, (x, y, z) in enumerate([(-3, 0, 0), (0, 2, 1), (2.5, -1.5, 0.5), (1, 1, 3)]):
        place = (x + offset[0], y + offset[1], z + offset[2])
        add(f"Box {i}", cube(size=1.0 + 0.3 * i), location=place)


def tilted(add: Any) -> None:
    """Thin boxes, none of them parallel to an axis."""
    for i in range(6):
        turn = Euler((0.5 + 0.3 * i, 0.4 * i, 0.9 - 0.2 * i))
        add(f"Plate {i}", cube(), location=(1.6 * i - 4, (-1) ** i, 0.4 * i), scale=(1, 1, 0.05), rotation_euler=turn)


def far_away(add: Any) -> None:
    """A curved grid and a box, kilometres from the world's origin."""
    mesh = grid(12)
    points = np.array([vertex.co for vertex in mesh.vertices])
    points[:, 2] = np.sin(3 * points[:, 0]) * points[:, 1]
    mesh.vertices.foreach_set("co", points.astype(np.float32).reshape(-1))
    add("Sea", mesh, location=(4000, -3000, 500), scale=(3, 3, 1))
    boxes(add, (4000, -3000, 502))


SCENES = [boxes, tilted, far_away]


def build(scene: Any, structure: str, **settings: Any) -> trees.Tree:
    scene.halfspace.structure = structure
    for key, value in {"show": True, "auto_update": False, **settings}.items():
        setattr(scene.halfspace.overlay, key, value)
    assert bpy.ops.halfspace.build_structure() == {"FINISHED"}
    tree = trees.last(scene)
    assert tree is not None
    return tree


def camera(tree: trees.Tree) -> tuple[Any, Any]:
    """View and projection from outside, from which all planes are in front."""
    outwards = Vector((7.0, -17.0, 9.0))
    turn = (-outwards).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    place = Matrix.Translation(Vector(tree.origin) + outwards) @ turn
    near, far, tangent = 0.5, 100.0, 0.42
    x, y = 1 / (tangent * WIDTH / HEIGHT), 1 / tangent
    depth = (-(far + near) / (far - near), -2 * far * near / (far - near))
    return place.inverted(), Matrix(((x, 0, 0, 0), (0, y, 0, 0), (0, 0, *depth), (0, 0, -1, 0)))


def picture(canvas: Any, scene: Any, view: Any, projection: Any) -> np.ndarray[Any, Any]:
    """(HEIGHT, WIDTH, 4) of the overlay over black."""
    with canvas.bind(), gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
        framebuffer = gpu.state.active_framebuffer_get()
        framebuffer.clear(color=(0, 0, 0, 0), depth=1.0)
        gpu.matrix.load_matrix(view)
        gpu.matrix.load_projection_matrix(projection)
        overlay.paint(scene, (WIDTH, HEIGHT))
        pixels = framebuffer.read_color(0, 0, WIDTH, HEIGHT, 4, 0, "FLOAT")
    return np.array(pixels.to_list(), np.float32).reshape(HEIGHT, WIDTH, 4)


def projected(tree: trees.Tree, view: Any, projection: Any, *, depth: int) -> list[tuple[int, np.ndarray[Any, Any]]]:
    """Kind and corners in pixels of each split polygon down to `depth`."""
    found = tree.structure.split_polygons(depth, 100_000)
    assert found["hidden"] == 0
    world = found["vertices"].astype(np.float64) + tree.origin
    clip = np.concatenate([world, np.ones((len(world), 1))], axis=1) @ (np.array(projection) @ np.array(view)).T
    assert (clip[:, 3] > 0).all()
    pixels = (clip[:, :2] / clip[:, 3:] + 1) / 2 * [WIDTH, HEIGHT]
    return (
        list(zip(found["kind"].tolist(), np.split(pixels, found["offsets"][1:-1].astype(int)), strict=True))
        if (len(found["kind"]))
        else []
    )


def distances(polygons: list[np.ndarray[Any, Any]]) -> np.ndarray[Any, Any]:
    """From each pixel's centre to the nearest edge of these polygons, (HEIGHT, WIDTH)."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    nearest = np.full((HEIGHT, WIDTH), np.inf)
    for polygon in polygons:
        for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            along, length = b - a, float((b - a) @ (b - a))
            t = np.clip(((x - a[0]) * along[0] + (y - a[1]) * along[1]) / length, 0, 1) if length else 0.0
            nearest = np.minimum(nearest, np.hypot(x - a[0] - t * along[0], y - a[1] - t * along[1]))
    return nearest


def inside(polygon: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Which pixels' centres lie in a convex polygon, whichever way round it is, (HEIGHT, WIDTH)."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    sides = [
        (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
        for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True)
    ]
    return (np.min(sides, axis=0) > 0) | (np.max(sides, axis=0) < 0)


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("make", SCENES)
def test_lines_are_where_the_planes_end_and_in_their_colours(
    scene: Any, add: Any, canvas: Any, make: Any, structure: str
) -> None:
    make(add)
    tree = build(scene, structure, style="OUTLINE", depth_max=3, opacity=1.0, line_width=2.0)
    view, projection = camera(tree)
    drawn = picture(canvas, scene, view, projection)
    polygons = projected(tree, view, projection, depth=3)
    every = distances([polygon for _, polygon in polygons])
    lit = drawn[..., 3] > 0.02
    # Widths are 1 to 2 pixels, whose edges fade over another.
    assert not lit[every > 3].any()
    if not polygons:
        assert structure == "brute"
        assert not lit.any()
        return
    assert lit[every < 0.3].mean() > 0.99
    assert 0.005 < lit.mean() < 0.6
    tints = overlay.colours()
    for kind in {kind for kind, _ in polygons}:
        others = distances([polygon for other, polygon in polygons if other != kind])
        alone = (distances([polygon for other, polygon in polygons if other == kind]) < 0.3) & (others > 4) & lit
        if alone.sum() >= 10:
            pure = drawn[alone][:, :3] / drawn[alone][:, :3].max(axis=1, keepdims=True)
            tint = np.array(tints[planes.KINDS[kind]])
            assert np.abs(pure - tint / tint.max()).max() < 0.02


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("make", SCENES)
def test_panes_cover_their_planes_and_nothing_else(
    scene: Any, add: Any, canvas: Any, make: Any, structure: str
) -> None:
    make(add)
    tree = build(scene, structure, style="FILL", depth_max=2, opacity=1.0)
    view, projection = camera(tree)
    drawn = picture(canvas, scene, view, projection)
    polygons = [polygon for _, polygon in projected(tree, view, projection, depth=2)]
    covered = np.any([inside(polygon) for polygon in polygons], axis=0) if polygons else np.zeros((HEIGHT, WIDTH), bool)
    edge = distances(polygons)
    lit = drawn[..., :3].max(axis=2) > 0
    assert not lit[~covered & (edge > 1)].any()
    if polygons:
        assert covered.mean() > 0.02
        assert lit[covered & (edge > 1)].mean() > 0.99


def test_depths_kinds_and_limit_choose_what_is_drawn(scene: Any, add: Any, canvas: Any) -> None:
    boxes(add)
    tree = build(scene, "kd", style="OUTLINE", depth_min=1, depth_max=3, kinds={"X"})
    view = camera(tree)
    drawn = picture(canvas, scene, *view)
    chosen = overlay.shown(scene)
    assert chosen is not None
    assert set(chosen.kind.tolist()) == {0}
    assert chosen.depth.min() >= 1
    red = np.array(overlay.colours()["X"])
    bright = drawn[drawn[..., 3] > 0.5][:, :3]
    assert len(bright)
    assert np.abs(bright / bright.max(axis=1, keepdims=True) - red / red.max()).max() < 0.02
    scene.halfspace.overlay.max_count = 1
    picture(canvas, scene, *view)
    limited = overlay.shown(scene)
    assert limited is not None
    assert (len(limited), limited.hidden) == (1, len(chosen) - 1)


def test_batches_are_made_once_per_tree_and_setting(scene: Any, add: Any, canvas: Any) -> None:
    boxes(add)
    view = camera(build(scene, "kd"))
    uid = scene.session_uid, "PLANES"
    picture(canvas, scene, *view)
    first = overlay._drawings[uid]
    picture(canvas, scene, *view)
    assert overlay._drawings[uid] is first
    scene.halfspace.overlay.opacity = 0.5
    picture(canvas, scene, *view)
    second = overlay._drawings[uid]
    assert second is not first
    assert second.chosen is first.chosen
    build(scene, "kd")
    assert overlay.shown(scene) is None
    picture(canvas, scene, *view)
    assert overlay._drawings[uid].tree != first.tree


def test_objects_hide_planes_as_far_as_wished(scene: Any, add: Any, canvas: Any) -> None:
    boxes(add)
    tree = build(scene, "kd", style="OUTLINE", depth_max=3, opacity=1.0, behind=0.0)
    view, projection = camera(tree)

    def covered_by(depth: float) -> float:
        with canvas.bind(), gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
            framebuffer = gpu.state.active_framebuffer_get()
            framebuffer.clear(color=(0, 0, 0, 0), depth=depth)
            gpu.matrix.load_matrix(view)
            gpu.matrix.load_projection_matrix(projection)
            overlay.paint(scene, (WIDTH, HEIGHT))
            pixels = framebuffer.read_color(0, 0, WIDTH, HEIGHT, 4, 0, "FLOAT")
        return float(np.array(pixels.to_list())[..., :3].sum())

    before = covered_by(1.0)
    assert covered_by(0.0) == 0.0
    scene.halfspace.overlay.behind = 0.5
    assert 0.1 * before < covered_by(0.0) < 0.6 * before
    assert covered_by(1.0) == pytest.approx(before)


def test_nothing_is_drawn_and_nothing_kept_when_switched_off(scene: Any, add: Any, canvas: Any) -> None:
    boxes(add)
    view = camera(build(scene, "kd"))
    assert picture(canvas, scene, *view).any()
    scene.halfspace.overlay.show = False
    assert not picture(canvas, scene, *view).any()
    assert not overlay._drawings


def test_handlers_come_and_go_with_the_wish(scene: Any) -> None:
    assert overlay._handle is None
    scene.halfspace.overlay.show = True
    handle = overlay._handle
    assert handle is not None
    scene.halfspace.overlay.show = True
    assert overlay._handle is handle
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert overlay._handle is None
    assert bpy.app.handlers.depsgraph_update_post.count(overlay._scene_changed) == 1


def test_an_edit_makes_the_tree_stale_but_a_camera_does_not(scene: Any, add: Any) -> None:
    box = add("Box", cube())
    lens = add("Camera", bpy.data.cameras.new("Camera"))
    tree = build(scene, "kd")
    lens.location.x = 3
    bpy.context.view_layer.update()
    assert not tree.stale
    box.location.x = 3
    bpy.context.view_layer.update()
    assert tree.stale
    tree = build(scene, "kd")
    assert not tree.stale
    bpy.data.objects.remove(box)
    bpy.context.view_layer.update()
    assert tree.stale


def test_a_render_leaves_its_tree_and_a_new_one_takes_its_place(scene: Any, add: Any) -> None:
    add("Box", cube())
    scene.camera = add("Camera", bpy.data.cameras.new("Camera"), location=(0, 0, 9))
    scene.render.engine = "HALFSPACE"
    scene.render.resolution_x = scene.render.resolution_y = 8
    scene.halfspace.samples = 1
    bpy.ops.render.render()
    tree = trees.last(scene)
    assert tree is not None
    assert tree.count == 12
    gone = weakref.ref(tree)
    del tree
    assert build(scene, "brute").spec == "brute"
    gc.collect()
    assert gone() is None
    assert bpy.ops.halfspace.free_structure() == {"FINISHED"}
    assert trees.last(scene) is None


def run_ticks() -> int:
    for count in range(100):
        if building._tick() is None:
            return count
        if building._Background.job is not None:
            building._Background.job._building.wait(60)
    pytest.fail("the build never ends")


def test_a_shown_tree_follows_the_scene_by_itself(scene: Any, add: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(building, "REST_SECONDS", 0.0)
    box = add("Box", cube())
    scene.halfspace.overlay.show = True
    run_ticks()
    first = trees.last(scene)
    assert first is not None
    box.location.x = 5
    bpy.context.view_layer.update()
    assert first.stale
    run_ticks()
    second = trees.last(scene)
    assert second is not None
    assert second.number > first.number
    assert second.origin[0] == pytest.approx(5)
    scene.halfspace.structure = "brute"
    run_ticks()
    assert trees.last(scene).spec == "brute"
    scene.halfspace.overlay.auto_update = False
    box.location.x = 6
    bpy.context.view_layer.update()
    assert trees.last(scene).stale
    assert run_ticks() == 0


def test_a_build_that_fails_by_itself_is_told(scene: Any, add: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_args: Any, **_kwargs: Any) -> None:
        raise ValueError("the scene\nis odd")

    monkeypatch.setattr(building, "REST_SECONDS", 0.0)
    monkeypatch.setattr(building.extract, "extract", fail)
    scene.halfspace.overlay.show = True
    run_ticks()
    assert building.problem() == "the scene is odd"
    with pytest.raises(RuntimeError, match="the scene is odd"):
        bpy.ops.halfspace.build_structure()
    building.stop()
    assert building.problem() == ""


class Operator:
    """The operator's own part, which Blender makes only in a window."""

    _job: Any = None
    _timer: Any = None
    _end = building.HALFSPACE_OT_build_structure._end

    def __init__(self) -> None:
        self.said: list[str] = []

    def report(self, _kind: Any, text: str) -> None:
        self.said.append(text)


@pytest.mark.parametrize("stopped", [True, False])
def test_the_operator_builds_while_blender_goes_on_and_esc_stops_it(scene: Any, add: Any, stopped: bool) -> None:
    add("Sea", grid(300))
    texts: list[str | None] = []
    calls: list[str] = []
    manager = SimpleNamespace(
        progress_begin=lambda *_: calls.append("begin"),
        progress_update=lambda *_: None,
        progress_end=lambda: calls.append("end"),
        event_timer_add=lambda *_args, **_kwargs: "timer",
        event_timer_remove=calls.append,
        modal_handler_add=lambda _operator: calls.append("modal"),
    )
    context = SimpleNamespace(
        scene=scene,
        window=None,
        window_manager=manager,
        workspace=SimpleNamespace(status_text_set=texts.append),
        evaluated_depsgraph_get=bpy.context.evaluated_depsgraph_get,
    )
    operator, kind = Operator(), building.HALFSPACE_OT_build_structure
    assert kind.invoke(operator, context, None) == {"RUNNING_MODAL"}
    assert kind.modal(operator, context, SimpleNamespace(type="MOUSEMOVE")) == {"PASS_THROUGH"}
    result: set[str] = {"PASS_THROUGH"}  # timers of others go on to them
    if stopped:
        result = kind.modal(operator, context, SimpleNamespace(type="ESC"))
    for _ in range(100_000):
        if result != {"PASS_THROUGH"}:
            break
        result = kind.modal(operator, context, SimpleNamespace(type="TIMER"))
    assert result == ({"CANCELLED"} if stopped else {"FINISHED"})
    assert calls == ["begin", "modal", "timer", "end"]
    assert texts[-1] is None
    assert (trees.last(scene) is None) == stopped
    assert operator.said == (
        ["Building was stopped"] if stopped else [f"{catalogue.load()['kd'].label} over 180,000 triangles"]
    )


def test_the_command_saves_a_picture_with_the_planes_in_it(
    canvas: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "planes.png"
    arguments = ["--size", "96x54", "--depth", "4-6", "--out", str(out)]
    view = ["--view", "5", "-8", "6", "0", "0.5", "0.7"]
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    assert overlay_picture.main([*arguments, *view]) == 0
    assert "planes of kd, 0 hidden" in capsys.readouterr().out
    drawn = pictures.load(out)[..., :3]
    assert drawn.shape == (54, 96, 3)
    # The scene is grey: whatever has a hue is a plane.
    assert 0.02 < ((drawn.max(axis=2) - drawn.min(axis=2)) > 0.1).mean() < 0.9
    assert overlay_picture.main([*arguments, "--depth", "x"]) == 2
    assert overlay_picture.main([str(tmp_path / "none.blend"), *arguments]) == 2
    assert capsys.readouterr().err.count("\n") == 2
    assert overlay_picture.main([*arguments, *view, "--structure", "kd:max_depth=5", "--traversal", "dir"]) == 0
    assert "planes of kd:max_depth=5,traversal=dir, 0 hidden" in capsys.readouterr().out
    assert properties.spec(bpy.context.scene.halfspace) == "kd:traversal=dir,max_depth=5"
    assert overlay_picture.main([*arguments, "--structure", "oak"]) == 2
    assert "--structure: unknown structure 'oak'; there are " in capsys.readouterr().err


def pane(vertices: np.ndarray[Any, Any], view: Any, projection: Any) -> np.ndarray[Any, Any]:
    """Corners in pixels of points in the world."""
    clip = np.concatenate([vertices, np.ones((len(vertices), 1))], axis=1) @ (np.array(projection) @ np.array(view)).T
    return (clip[:, :2] / clip[:, 3:] + 1) / 2 * [WIDTH, HEIGHT]


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("make", SCENES)
def test_leaves_cover_their_cells_and_the_fullest_is_brightest(
    scene: Any, add: Any, canvas: Any, make: Any, structure: str
) -> None:
    make(add)
    tree = build(scene, structure, parts={"CELLS"}, style="FILL", opacity=1.0, max_count=120)
    view, projection = camera(tree)
    drawn = picture(canvas, scene, view, projection)
    found = tree.structure.leaf_cells(1, 20)
    assert len(overlay.shown(scene, "CELLS")) == len(found["count"])
    polygons = np.split(found["vertices"].astype(np.float64) + tree.origin, found["offsets"][1:-1].astype(int))
    flat = [pane(polygon, view, projection) for polygon in polygons]
    covered, edge = np.any([inside(polygon) for polygon in flat], axis=0), distances(flat)
    lit = drawn[..., :3].max(axis=2) > 0.01
    assert not lit[~covered & (edge > 1.5)].any()
    within = covered & (edge > 1.5)
    assert lit.any()
    if not within.any():
        return
    assert lit[within].mean() > 0.99
    # Every pixel has a hue of the scale: each colour is a mix of those of the counts.
    hues = colours.of_counts(found["count"].astype(np.int64))
    lowest, highest = (hues / hues.max(axis=1, keepdims=True)).min(axis=0), hues.max(axis=0) / hues.max(axis=1).min()
    pure = drawn[within][:, :3]
    pure = pure / pure.max(axis=1, keepdims=True)
    assert (pure > lowest - 0.03).all()
    assert (pure < highest + 0.03).all()


@pytest.mark.parametrize("structure", STRUCTURES)
def test_a_picked_ray_shows_its_cells_its_triangles_and_its_hit(
    scene: Any, add: Any, canvas: Any, structure: str
) -> None:
    far_away(add)
    tree = build(scene, structure, parts={"RAY"}, opacity=1.0, line_width=3.0)
    assert not picture(canvas, scene, *camera(tree)).any()
    centre = Vector(tree.origin)
    box = next(item for item in scene.objects if item.name == "Box 3").location
    start = box + Vector((9.0, -7.0, 5.0))
    assert bpy.ops.halfspace.pick_ray(origin=start, direction=box - start) == {"FINISHED"}
    view, projection = camera(tree)
    drawn = picture(canvas, scene, view, projection)
    path = overlay.shown(scene, "RAY")
    assert path.triangle >= 0
    expected = tree.structure.closest(np.array([start - centre], np.float32), np.array([box - start], np.float32))
    assert (path.triangle, path.t) == (
        expected.triangle[0],
        pytest.approx(float(expected.t[0]), rel=1e-4),
    )  # the world's coordinates are f32
    # The ray is white from its origin to the hit, and seen on all of its way inside the picture.
    ends = pane(np.array([start, start + (box - start) * path.t], np.float64), view, projection)
    along = ends[0] + np.linspace(0.02, 0.98, 60)[:, None] * (ends[1] - ends[0])
    inside_picture = ((along >= 1) & (along < [WIDTH - 1, HEIGHT - 1])).all(axis=1)
    assert inside_picture.sum() > 10
    pixels = along[inside_picture].astype(int)
    assert drawn[pixels[:, 1], pixels[:, 0], :3].min() > 0.6
    # Nothing outside what the visited cells, the planes and the ray cover.
    polygons = np.split(path.cells.vertices + tree.origin, path.cells.offsets[1:-1])
    polygons += np.split(path.crossings.vertices + tree.origin, path.crossings.offsets[1:-1])
    flat = [pane(polygon.astype(np.float64), view, projection) for polygon in polygons if len(polygon)]
    covered = np.any([inside(polygon) for polygon in flat], axis=0)
    far = distances([*flat, ends]) > 4
    assert not (drawn[..., :3].max(axis=2) > 0.02)[~covered & far].any()
    assert bpy.ops.halfspace.forget_ray() == {"FINISHED"}
    assert not picture(canvas, scene, view, projection).any()


@pytest.mark.parametrize("structure", STRUCTURES)
def test_a_beam_shows_what_its_rays_share(scene: Any, add: Any, canvas: Any, structure: str) -> None:
    far_away(add)
    tree = build(scene, structure, parts={"BEAM"}, opacity=1.0, line_width=3.0, beam_spacing=10.0)
    box = next(item for item in scene.objects if item.name == "Box 3").location
    start = box + Vector((9.0, -7.0, 5.0))
    assert bpy.ops.halfspace.pick_ray(origin=start, direction=box - start, pixel=0.002) == {"FINISHED"}
    view, projection = camera(tree)
    drawn = picture(canvas, scene, view, projection)
    beam = overlay.shown(scene, "BEAM")
    # Eight by eight rays around the picked one, with ten pixels of 0.002 between neighbours.
    along = beam.directions @ np.array((box - start).normalized())
    assert along == pytest.approx(1.0, abs=1e-5)
    steps = np.diff(beam.directions.reshape(8, 8, 3), axis=1)
    assert np.linalg.norm(steps, axis=-1) == pytest.approx(0.02, rel=1e-4)
    # What each ray meets is what the structure says, and each triangle is shown once.
    origins, directions = (part.astype(np.float32) for part in (beam.origins, beam.directions))
    expected = tree.structure.closest(origins, directions)
    assert np.array_equal(beam.t.astype(np.float32), expected.t)
    assert len(beam.hits) == len(set(expected.triangle.tolist()) - {-1})
    assert beam.cells.count.max() <= 64
    assert beam.cells.count.sum() == beam.visits
    # Its four edges are white to where they end, and outside beam, cells and hits there is nothing.
    ends = np.stack([beam.origins[list(beams.CORNERS)], beams.ends(beam)], axis=1) + tree.origin
    edges = [pane(end, view, projection) for end in ends]
    for first, last in edges:
        points = first + np.linspace(0.03, 0.97, 40)[:, None] * (last - first)
        points = points[((points >= 1) & (points < [WIDTH - 1, HEIGHT - 1])).all(axis=1)].astype(int)
        assert drawn[points[:, 1], points[:, 0], :3].min() > 0.55
    polygons = np.split(beam.cells.vertices + tree.origin, beam.cells.offsets[1:-1])
    polygons += [corners + tree.origin for corners in beam.hits]
    polygons += [np.array([*ends[i], ends[j][1]]) for i, j in zip(range(4), (1, 2, 3, 0), strict=True)]
    flat = [pane(polygon.astype(np.float64), view, projection) for polygon in polygons if len(polygon)]
    covered, far = np.any([inside(polygon) for polygon in flat], axis=0), distances(flat) > 4
    assert not (drawn[..., :3].max(axis=2) > 0.02)[~covered & far].any()


def test_a_tile_taken_together_takes_fewer_steps(scene: Any, add: Any) -> None:
    boxes(add)
    tree = build(scene, "octree-beam")
    ray = picking.Ray((9.0, -7.0, 5.0), (-9.0, 7.0, -4.0), pixel=0.001)
    beam = beams.follow(tree.structure, *ray.tile(tree.origin, 4.0))
    assert beam.together[0] < beam.alone[0]
    assert "Together" in beam.lines()[-1]
    alone = beams.follow(native.load().build(*some_triangles(), "octree-net"), *ray.tile(tree.origin, 4.0))
    assert alone.together == alone.alone
    parallel = picking.Ray((0.0, 0.0, 9.0), (0.0, 0.0, -1.0), pixel=0.25, parallel=True).tile((0, 0, 0), 2.0)
    assert np.ptp(parallel[0], axis=0) == pytest.approx([3.5, 3.5, 0.0])
    assert np.ptp(parallel[1], axis=0) == pytest.approx(0.0)


def test_the_cursor_picks_a_ray_and_esc_gives_the_last_one_back(scene: Any, add: Any) -> None:
    boxes(add)
    build(scene, "kd")
    assert bpy.ops.halfspace.pick_ray(origin=(0, 0, 9), direction=(0, 0, -1)) == {"FINISHED"}
    first = picking.last(scene)
    calls: list[Any] = []
    window = SimpleNamespace(cursor_modal_set=calls.append, cursor_modal_restore=lambda: calls.append("restored"))
    context = SimpleNamespace(
        scene=scene,
        window=window,
        screen=bpy.context.window.screen,
        window_manager=SimpleNamespace(modal_handler_add=lambda _operator: None),
        workspace=SimpleNamespace(status_text_set=lambda _text: None),
    )
    area = next(area for area in context.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    kind = picking.HALFSPACE_OT_pick_ray
    operator = SimpleNamespace(report=print, pixel=1e-3)
    operator._end, operator._leave = (MethodType(found, operator) for found in (kind._end, kind._leave))
    middle = {"mouse_x": region.x + region.width // 2, "mouse_y": region.y + region.height // 2}
    assert kind.invoke(operator, context, None) == {"RUNNING_MODAL"}
    assert kind.modal(operator, context, SimpleNamespace(type="MOUSEMOVE", value="", **middle)) == {"RUNNING_MODAL"}
    moved = picking.last(scene)
    assert moved != first
    assert kind.modal(operator, context, SimpleNamespace(type="ESC", value="PRESS")) == {"CANCELLED"}
    assert picking.last(scene) == first
    assert kind.invoke(operator, context, None) == {"RUNNING_MODAL"}
    assert kind.modal(operator, context, SimpleNamespace(type="LEFTMOUSE", value="PRESS", **middle)) == {"FINISHED"}
    assert picking.last(scene) == moved
    # What is adjusted afterwards begins with what was picked.
    assert (operator.origin, operator.direction, operator.pixel) == (moved.origin, moved.direction, moved.pixel)
    assert calls == ["EYEDROPPER", "restored"] * 2
