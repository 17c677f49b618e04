# SPDX-License-Identifier: GPL-3.0-or-later
"""The inspector's operators: nodes, worst rays, levels, the step of a ray, files."""

import csv
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import gpu
import numpy as np
import pytest
from mathutils import Matrix

from addon.blender.inspector import levels, map_cursor, worst
from addon.blender.measure import cost_maps, map_pictures, pictures
from addon.blender.overlay import choosing, drawing, framing, legend, picking, replaying
from addon.blender.session import trees
from addon.blender.settings import signals
from addon.blender.ui import inspector_panels, overlay_panels
from addon.core.overlay.legend import Entry
from tests.blender.drawn import build, plates
from tests.blender.layouts import draw, draw_all

WIDTH, HEIGHT = 200, 150


@pytest.fixture
def seen(scene: Any, add: Any) -> Any:
    return plates(scene, add)


def maps_of(scene: Any) -> cost_maps.Kept:
    """The maps of the picture, which shows this scene."""
    kept = cost_maps.KEPT.of(scene)
    assert kept is not None
    return kept


def paint(canvas: Any, scene: Any) -> None:
    with canvas.bind():
        drawing.paint(scene, (WIDTH, HEIGHT))


@pytest.mark.parametrize("structure", ["kd", "bvh-sah"])
def test_the_browser_goes_to_parents_children_and_siblings(seen: Any, structure: str) -> None:
    tree = build(seen, structure)
    go, settings = bpy.ops.halfspace.go_to_node, seen.halfspace.inspector
    assert go(to="ROOT") == {"FINISHED"}
    table = tree.table()
    assert settings.node == 0
    assert "NODE" in seen.halfspace.overlay.parts
    go(to="CHILD", index=1)
    assert settings.node == table.children_of(0)[1]
    go(to="NEXT")
    go(to="PREVIOUS")
    assert settings.node == table.children_of(0)[1]
    go(to="PARENT")
    assert settings.node == 0
    go(to="COSTLIEST")
    assert settings.node == table.costliest_child(0)
    go(to="LEAF")
    assert settings.node == table.costliest_leaf()
    with pytest.raises(RuntimeError, match="no such node"):
        go(to="CHILD", index=0)
    # A number beyond the last node is the root.
    settings.node = 10**6
    go(to="CHILD", index=0)
    assert settings.node == table.children_of(0)[0]


def region(scene: Any) -> Any:
    """The first 3D view."""
    areas = [area for area in bpy.context.screen.areas if area.type == "VIEW_3D"]
    return max(areas, key=lambda area: area.width * area.height).spaces.active.region_3d


def test_the_view_frames_the_selected_node(seen: Any) -> None:
    tree = build(seen, "kd")
    go, settings = bpy.ops.halfspace.go_to_node, seen.halfspace.inspector
    table, sizes = tree.table(), []
    for select in (lambda: go(to="ROOT"), lambda: go(to="LEAF")):
        select()
        assert bpy.ops.halfspace.frame_node() == {"FINISHED"}
        low, high = table.bounds[settings.node].reshape(2, 3)
        view = region(seen)
        assert np.array(view.view_location) == pytest.approx((low + high) / 2 + tree.origin, abs=1e-3)
        sizes.append(view.view_distance / np.linalg.norm(high - low))
    assert sizes == [pytest.approx(framing.NODE_MARGIN)] * 2
    # The costliest leaf is framed at once.
    view.view_distance = 100.0
    go(to="LEAF")
    assert view.view_distance < 100.0


@pytest.mark.parametrize("across", [(1, 0, 0), (0, 0, -1), (-3, 2, 1), (0, 1, 1e-6)])
def test_a_direction_seen_from_the_side_is_level_and_seen_from_above(across: tuple[float, ...]) -> None:
    turn = np.array(framing.sideways(np.array(across, float), np.array([1.0, 0.0, 0.0])).to_matrix())
    assert turn.T @ turn == pytest.approx(np.eye(3), abs=1e-6)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    assert abs(turn[:, 0] @ across) == pytest.approx(np.linalg.norm(across))
    assert turn[0, 0] >= -1e-6
    assert turn[2, 2] >= -1e-6


def test_a_selected_node_is_drawn_and_can_be_alone(seen: Any, canvas: Any) -> None:
    tree = build(seen, "kd")
    bpy.ops.halfspace.go_to_node(to="COSTLIEST")
    assert choosing.parts(seen) == ["PLANES", "NODE", "RAY"]
    paint(canvas, seen)
    view = drawing.shown(seen, "NODE")
    table = tree.table()
    assert view.children == tuple(table.children_of(view.node))
    assert len(view.corners) == len(table.triangles_of(view.node))
    texts = [entry.text for entry in drawing.legend_of(seen)]
    assert "node" in texts
    assert "plane across X" in texts
    seen.halfspace.inspector.alone = True
    assert choosing.parts(seen) == ["NODE"]
    texts = [entry.text for entry in drawing.legend_of(seen)]
    assert texts[0] == "node"
    assert texts[-1] == f"its {len(view.corners):,} triangles"
    bpy.ops.halfspace.go_to_node(to="LEAF")
    paint(canvas, seen)
    assert next(entry.text for entry in drawing.legend_of(seen)) == "leaf"
    seen.halfspace.overlay.legend = False
    assert drawing.legend_of(seen) == []


def test_the_legend_shows_its_colours_in_the_corner(canvas: Any) -> None:
    entries = [
        Entry(((1.0, 0.0, 0.0),), "red"),
        Entry(((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), "a scale"),
        Entry((), "words"),
    ]
    x, y = 2 / WIDTH, 2 / HEIGHT
    pixels_to_clip = Matrix(((x, 0, 0, -1), (0, y, 0, -1), (0, 0, -1, 0), (0, 0, 0, 1)))
    with canvas.bind(), gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
        framebuffer = gpu.state.active_framebuffer_get()
        framebuffer.clear(color=(0, 0, 0, 0))
        gpu.matrix.load_matrix(Matrix.Identity(4))
        gpu.matrix.load_projection_matrix(pixels_to_clip)
        legend.draw(entries, 0.0, 1.0)
        read = framebuffer.read_color(0, 0, WIDTH, HEIGHT, 4, 0, "FLOAT")
    drawn = np.array(read.to_list(), np.float32).reshape(HEIGHT, WIDTH, 4)[..., :3]
    # Letters are white; the others are the pure colours of the entries.
    red, green, blue = (np.argwhere(np.abs(drawn - np.eye(3)[k]).max(axis=2) < 0.1) for k in range(3))
    assert len(red) > 200
    assert len(green) > 80
    assert len(blue) > 80
    # The first entry is the highest, and the colours of a scale go to the right.
    assert red[:, 0].min() > green[:, 0].max()
    assert green[:, 1].max() < blue[:, 1].min()


@pytest.mark.parametrize("name", ["primary", "shadow", "diffuse"])
@pytest.mark.parametrize("key", ["STEPS", "TESTS", "TIME"])
def test_the_worst_ray_is_picked_and_explained(seen: Any, name: str, key: str) -> None:
    tree = build(seen, "kd")
    settings = seen.halfspace.inspector
    settings.rays, settings.order = name, key
    assert bpy.ops.halfspace.worst_ray() == {"FINISHED"}
    found, ray = worst.known(seen), picking.last(seen)
    costs = found.costs[name]
    indices, values = worst.order(found, tree, name, key)
    assert ray.any_hit == (name == "shadow")
    assert ray.path(tree).tests == costs.tests[indices[0]]
    if key != "TIME":
        assert values[0] == costs.values(key).max()
    else:
        assert any("0 of " in line and "answers wrong" in line for line in found.lines)
    assert found.lines[0].startswith("1 of ")
    # The view looks at the ray from the side, unless that is switched off.
    view, way = region(seen), np.array(ray.direction) / np.linalg.norm(ray.direction)
    assert abs(np.array(view.view_rotation.to_matrix())[:, 2] @ way) < 1e-3
    settings.from_side, view.view_distance = False, 123.0
    bpy.ops.halfspace.worst_ray()
    assert view.view_distance == pytest.approx(123.0)
    bpy.ops.halfspace.worst_ray(move=1)
    assert found.lines[0].startswith("2 of ")
    assert picking.last(seen) != ray
    bpy.ops.halfspace.worst_ray(move=-1)
    assert picking.last(seen) == ray
    bpy.ops.halfspace.worst_ray(move=-1)
    assert found.place == len(indices) - 1
    # Another tree needs other counts.
    build(seen, "bvh-sah")
    assert worst.known(seen) is None


@pytest.mark.parametrize("change", ["place", "lens", "shape", "width"])
def test_another_view_needs_other_rays(seen: Any, change: str) -> None:
    tree = build(seen, "kd")
    bpy.ops.halfspace.worst_ray()
    bpy.ops.halfspace.measure_levels()
    before = worst.known(seen)
    assert before is not None
    assert levels.known(seen) is not None
    if change == "place":
        seen.camera.location.x += 0.5
        bpy.context.view_layer.update()
    elif change == "lens":
        seen.camera.data.lens *= 1.5
    elif change == "shape":
        seen.render.resolution_y *= 2
    else:
        seen.halfspace.inspector.width *= 2
    assert worst.known(seen) is None
    assert levels.known(seen) is None
    after = worst.find(seen, tree)
    assert after is worst.known(seen)
    assert not np.array_equal(after.costs["primary"].rays.directions, before.costs["primary"].rays.directions) or (
        change == "place" and (after.costs["primary"].rays.origins != before.costs["primary"].rays.origins).any()
    )


def test_a_view_without_hits_has_no_shadow_rays(seen: Any) -> None:
    seen.camera.rotation_euler = (np.pi, 0, 0)
    build(seen, "kd")
    seen.halfspace.inspector.rays = "shadow"
    with pytest.raises(RuntimeError, match="nothing is hit"):
        bpy.ops.halfspace.worst_ray()


def test_a_replayed_ray_ends_at_its_step(seen: Any, canvas: Any) -> None:
    tree = build(seen, "kd")
    bpy.ops.halfspace.worst_ray()
    settings = seen.halfspace.inspector
    settings.replaying, settings.step = True, 1
    paint(canvas, seen)
    found = replaying.known(seen)
    assert found is not None
    path = drawing.shown(seen, "RAY")
    assert "node of this step" in [entry.text for entry in drawing.legend_of(seen)]
    drawn = []
    for step in range(1, len(found) + 1):
        settings.step = step
        levels_of_step = choosing.levels(seen, "RAY", path, drawing.colours(), 1.0)
        drawn.append(sum(len(level.triangles) for level in levels_of_step))
        assert bpy.ops.halfspace.go_to_node(to="STEP") == {"FINISHED"}
        assert settings.node == found.steps[step - 1].node
    settings.replaying = False
    whole = sum(len(level.triangles) for level in choosing.levels(seen, "RAY", path, drawing.colours(), 1.0))
    assert drawn[0] < drawn[-1]
    # The last step shows everything, and the node itself.
    assert drawn[-1] > whole
    assert tree.known_table is not None


def test_levels_are_measured_and_shown(seen: Any) -> None:
    tree = build(seen, "kd")
    assert levels.known(seen) is None
    assert bpy.ops.halfspace.measure_levels() == {"FINISHED"}
    found = levels.known(seen)
    statistics = tree.structure.statistics
    assert sum(level.sah for level in found.levels.levels) == pytest.approx(statistics["sah_cost"], rel=1e-6)
    texts = draw(inspector_panels.HALFSPACE_PT_view_levels, scene=seen)
    assert " ".join(found.lines) in " ".join(texts)  # lines are wrapped
    assert "EPO" in texts


@pytest.mark.parametrize("what", ["NODES", "STEPS", "RAYS", "LEVELS", "MAP", "PICTURE"])
def test_everything_is_written(seen: Any, tmp_path: Path, what: str) -> None:
    path = tmp_path / ("map.png" if what == "PICTURE" else "table.csv")

    def export() -> Any:
        return bpy.ops.halfspace.export_inspector(filepath=str(path), what=what)

    with pytest.raises(RuntimeError, match="first"):
        export()
    tree = build(seen, "kd")
    if what == "STEPS":
        with pytest.raises(RuntimeError, match="Pick a ray first"):
            export()
        bpy.ops.halfspace.worst_ray()
    if what in ("MAP", "PICTURE"):
        seen.halfspace.cost = "STEPS"
        assert bpy.ops.halfspace.cost_map(width=64) == {"FINISHED"}
    assert export() == {"FINISHED"}
    if what == "PICTURE":
        wanted = maps_of(seen).picture(seen)
        assert np.abs(pictures.load(path)[..., :3] - wanted).max() < 0.01
        return
    rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
    lengths = {
        "NODES": lambda: len(tree.table()),
        "STEPS": lambda: len(replaying.known(seen) or ()),
        "RAYS": lambda: 64 * 32,
        "LEVELS": lambda: int(tree.table().depth.max()) + 1,
        "MAP": lambda: 64 * 32,
    }
    assert len(rows) == lengths[what]()
    if what == "RAYS":
        # The ray that the panel shows first is the first of the file, with its time and the errors of the structure.
        found = worst.known(seen)
        assert found is not None
        index = int(worst.order(found, tree, "primary", "STEPS")[0][0])
        measured = worst.times(found, tree, "primary")
        assert (rows[0]["rank"], rows[0]["ray"], rows[0]["kind"]) == ("1", str(index), "camera")
        assert float(rows[0]["nanoseconds"]) == pytest.approx(measured.nanoseconds[index // 64], rel=1e-8)
        assert (rows[0]["wrong_answers"], rows[0]["compared_answers"]) == ("0", str(measured.compared))


def test_the_steps_have_a_button_that_writes_them(seen: Any, canvas: Any) -> None:
    build(seen, "kd")
    bpy.ops.halfspace.worst_ray()

    def files() -> list[str]:
        drawn = draw_all(overlay_panels.HALFSPACE_PT_view_ray, scene=seen).operators
        return [one.what for one in drawn if one.id == "halfspace.export_inspector"]

    assert files() == []
    seen.halfspace.inspector.replaying = True
    paint(canvas, seen)
    assert files() == ["STEPS"]


def test_the_page_holds_both_structures(seen: Any, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    with pytest.raises(RuntimeError, match="Build a structure first"):
        bpy.ops.halfspace.export_inspector(filepath=str(path), what="PAGE")
    build(seen, "kd")
    seen.halfspace.second = "bvh-sah"
    assert bpy.ops.halfspace.export_inspector(filepath=str(path), what="PAGE") == {"FINISHED"}
    text = path.read_text(encoding="utf-8")
    assert "kd-tree" in text
    assert "Bounding volume hierarchy" in text
    # Its view has the shape of the render.
    assert "64 × 32 camera rays" in text


def test_a_dot_in_the_name_of_a_file_is_kept(seen: Any, tmp_path: Path) -> None:
    build(seen, "kd")
    bpy.ops.halfspace.export_inspector(filepath=str(tmp_path / "view.1"), what="NODES")
    assert [path.name for path in tmp_path.iterdir()] == ["view.1.csv"]


def test_one_cursor_reads_both_maps_and_picks_its_ray(seen: Any) -> None:
    group = seen.halfspace
    group.structure, group.second, group.cost = "kd", "bvh-sah", "TESTS"
    build(seen, "kd")
    bpy.ops.halfspace.cost_map(width=64)
    kept = maps_of(seen)
    assert len(kept.maps) == 2
    row, column = np.unravel_index(int(kept.maps[0][1].argmax()), kept.maps[0][1].shape)
    assert bpy.ops.halfspace.map_cursor(column=int(column), row=int(row)) == {"FINISHED"}
    tree, ray = trees.last(seen), picking.last(seen)
    assert tree is not None
    # It goes through the centre of the pixel.
    workload_ray = np.array(ray.direction)
    tangent = np.tan(seen.camera.data.angle / 2)
    x, y = ((column + 0.5) / 64 * 2 - 1) * tangent, ((row + 0.5) / 32 * 2 - 1) * tangent / 2
    assert workload_ray == pytest.approx(np.array([x, y, -1]) / np.sqrt(x * x + y * y + 1), abs=1e-6)
    assert ray.origin == pytest.approx(tuple(seen.camera.location), abs=1e-4)
    # Both maps show the cursor in the same pixel.
    picture = kept.picture(seen)
    for number in (0, 1):
        left = map_pictures.left(number, 64)
        crossed = picture[map_pictures.foot() + int(row), left : left + 64]
        assert (np.abs(crossed - map_pictures.CURSOR_RGB).max(axis=1) < 0.01).sum() == 63
        assert map_pictures.pixel_at(left + column + 0.5, map_pictures.foot() + row + 0.5, 2, (64, 32)) == (column, row)
    assert map_pictures.pixel_at(2.0, 2.0, 2, (64, 32)) is None
    with pytest.raises(RuntimeError, match="64 × 32"):
        bpy.ops.halfspace.map_cursor(column=64, row=0)
    map_cursor.place(seen, None)
    assert kept.cursor is None


def test_a_range_takes_colour_from_the_other_pixels(seen: Any) -> None:
    seen.halfspace.cost = "TESTS"
    build(seen, "kd")
    bpy.ops.halfspace.cost_map(width=64)
    image, kept = bpy.data.images[cost_maps.IMAGE], maps_of(seen)
    before = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(before)
    (own,) = kept.ranges(seen)
    own.low = 50.0
    drawn = kept.picture(seen)
    assert tuple(image.size) == drawn.shape[1::-1]
    values = kept.maps[0][1]
    part = drawn[map_pictures.foot() :, map_pictures.MARGIN :][:32, :64]
    coloured = np.ptp(part, axis=2) > 0.01
    end = cost_maps.costmap.scale_end([values])
    assert (coloured == (values >= end / 2)).mean() > 0.99
    own.low = 0.0
    after = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(after)
    assert np.array_equal(before, after)


def test_each_map_keeps_a_range_of_its_own(seen: Any) -> None:
    group = seen.halfspace
    group.structure, group.second, group.cost = "kd", "bvh-sah", "TESTS"
    build(seen, "kd")

    def show(cost: str) -> list[Any]:
        group.cost = cost
        bpy.ops.halfspace.cost_map(width=64)
        return maps_of(seen).ranges(seen)

    def grey(place: int) -> float:
        """The share of a map's pixels without colour."""
        x = map_pictures.left(place, 64)
        drawn = maps_of(seen).picture(seen)[map_pictures.foot() :][:32, x : x + 64]
        return float((np.ptp(drawn, axis=2) < 0.01).mean())

    first, second = show("TESTS")
    first.low, second.high = 100.0, 0.0
    assert grey(0) > 0.9
    values = maps_of(seen).maps[1][1]
    assert grey(1) == pytest.approx(float((values > 0).mean()))
    # Maps of another quantity have whole ranges, and these stay as they were.
    assert [(one.low, one.high) for one in show("STEPS")] == [(0, 100), (0, 100)]
    assert grey(0) == grey(1) == 0
    assert [(one.low, one.high) for one in show("TESTS")] == [(100, 100), (0, 0)]
    # The panel has one pair of ends for each map; undone beyond the first map there are none, and no pixel is grey.
    panel = inspector_panels.HALFSPACE_PT_image_maps
    labels = [title for title, _ in maps_of(seen).maps]
    assert set(labels) <= set(draw(panel, scene=seen))
    group.inspector.ranges.clear()
    assert grey(0) == grey(1) == 0
    assert not set(labels) & set(draw(panel, scene=seen))


def test_undo_draws_the_range_again(seen: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    build(seen, "kd")
    bpy.ops.halfspace.cost_map(width=64)
    image = bpy.data.images[cost_maps.IMAGE]
    before, after = (np.empty(len(image.pixels), np.float32) for _ in range(2))
    image.pixels.foreach_get(before)
    # Undo changes a setting without its callback.
    with monkeypatch.context() as patch:
        patch.setattr(signals.range_changed, "_listeners", [])
        maps_of(seen).ranges(seen)[0].low = 50.0
    for handler in bpy.app.handlers.undo_post:
        handler(seen)
    image.pixels.foreach_get(after)
    assert not np.array_equal(before, after)


def test_a_cancelled_cursor_shows_the_ray_of_before(seen: Any) -> None:
    build(seen, "kd")
    bpy.ops.halfspace.cost_map(width=64)
    before = picking.Ray((0.0, 0.0, 9.0), (0.0, 0.0, -1.0))
    map_cursor.place(seen, (3, 4))
    window = SimpleNamespace(cursor_modal_restore=lambda: None)
    operator: Any = map_cursor.HALFSPACE_OT_map_cursor
    ended = operator._cancel(SimpleNamespace(_before=before), SimpleNamespace(scene=seen, window=window))
    assert ended == {"CANCELLED"}
    assert picking.last(seen) == before
    assert maps_of(seen).cursor is None


def test_depths_are_chosen_until_they_are_set(seen: Any, canvas: Any) -> None:
    settings = seen.halfspace.overlay
    tree = build(seen, "octree-net")
    paint(canvas, seen)
    with canvas.bind():
        chosen = tree.survey().first(drawing._viewer(tree))
    shown = drawing.shown(seen).levels
    assert (shown.start, shown.stop - 1) == (chosen.low, chosen.high)
    assert shown.stop - 1 < len(tree.survey().counts) - 1, "the whole tree"
    assert settings.depth_auto
    settings.depth_min = 9
    assert not settings.depth_auto
    assert settings.depth_max == 9  # the other end makes room
    settings.depth_max = 3
    assert settings.depth_min == 3


def test_the_panel_offers_only_kinds_of_the_tree(seen: Any, canvas: Any) -> None:
    tree = build(seen, "octree-net")
    paint(canvas, seen)
    assert tree.known_survey is not None
    assert tree.survey().kinds == ("OCTANTS",)
    offered: list[str] = []

    class Flow:
        use_property_split = False

        def prop_enum(self, _data: Any, _name: str, kind: str) -> None:
            offered.append(kind)

    class Anything:
        def __getattr__(self, name: str) -> Any:
            return lambda *_args, **_more: Flow() if name == "grid_flow" else Anything()

    overlay_panels._depth_and_kinds(Anything(), seen.halfspace.overlay, tree)
    assert offered == ["OCTANTS"]
