# SPDX-License-Identifier: GPL-3.0-or-later
"""Two structures side by side in the panels of rays and levels, all children of a node, histograms over sliders."""

from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.inspector import levels, second, worst
from addon.blender.measure import cost_maps
from addon.blender.overlay import drawing, picking
from addon.blender.ui import histogram_icons, inspector_panels, overlay_panels
from addon.core.inspector import levels as measuring
from addon.core.overlay import cells
from tests.blender.drawn import build, plates
from tests.blender.layouts import draw, draw_all

WIDTH, HEIGHT = 200, 150


@pytest.fixture
def seen(scene: Any, add: Any) -> Any:
    return plates(scene, add)


def after(texts: list[str], title: str) -> list[str]:
    """The two texts that follow a title in a panel."""
    at = texts.index(title)
    return texts[at + 1 : at + 3]


@pytest.mark.parametrize("name", ["primary", "shadow", "diffuse"])
@pytest.mark.parametrize("key", ["STEPS", "TIME"])
def test_the_worst_ray_is_counted_in_both_structures(seen: Any, name: str, key: str) -> None:
    tree = build(seen, "kd")
    seen.halfspace.second = "bvh-sah"
    settings = seen.halfspace.inspector
    settings.rays, settings.order = name, key
    assert bpy.ops.halfspace.worst_ray() == {"FINISHED"}
    found, other = worst.known(seen), second.known(seen)
    assert found is not None
    assert other.spec == "bvh-sah"
    assert other.triangles is tree.triangles
    texts = draw(inspector_panels.HALFSPACE_PT_view_worst, scene=seen)
    assert after(texts, "")[:2] == ["kd", "bvh-sah"]
    # Both numbers are those of the ray that is picked.
    ray, index = picking.last(seen), int(worst.order(found, tree, name, key)[0][0])
    assert ray is not None
    costs = found.costs[name]
    counted = other.structure.record(
        costs.rays.origins[index : index + 1],
        costs.rays.directions[index : index + 1],
        None,
        costs.rays.t_max[index : index + 1],
        any_hit=costs.rays.any_hit,
    ).counters
    assert after(texts, "Tests") == [f"{costs.tests[index]:,}", f"{int(counted['tests'][0]):,}"]
    assert after(texts, "Steps") == [f"{costs.steps[index]:,}", f"{int(counted['visits'][0]):,}"]
    assert ("ns, 64 neighbours" in texts) == (key == "TIME")
    # A time is next to the errors of the same structure.
    assert ("Wrong" in texts) == (key == "TIME")
    # Another choice hides the numbers of the last one.
    seen.halfspace.second = "NONE"
    assert "bvh-sah" not in draw(inspector_panels.HALFSPACE_PT_view_worst, scene=seen)


def test_a_picked_ray_is_followed_through_both(seen: Any, canvas: Any) -> None:
    build(seen, "kd")
    seen.halfspace.second = "octree-net"
    bpy.ops.halfspace.pick_ray(origin=(0.2, 0.1, 16), direction=(0.02, 0.03, -1))
    with canvas.bind():
        drawing.paint(seen, (WIDTH, HEIGHT))
    panel = overlay_panels.HALFSPACE_PT_view_ray
    assert "Inner nodes" not in draw(panel, scene=seen)
    assert bpy.ops.halfspace.build_second() == {"FINISHED"}
    other, ray = second.known(seen), picking.last(seen)
    path = cells.follow(other.structure, *ray.within(other.origin))
    texts = draw(panel, scene=seen)
    assert after(texts, "Tests") == [f"{drawing.shown(seen, 'RAY').tests:,}", f"{path.tests:,}"]
    # Both answer the same.
    assert path.triangle == drawing.shown(seen, "RAY").triangle
    # A new first structure needs a new second one.
    build(seen, "bvh-sah")
    assert second.known(seen) is None
    assert not second.SECOND.all()


def test_levels_of_both_stand_side_by_side(seen: Any) -> None:
    build(seen, "kd")
    seen.halfspace.second = "bvh-sah"
    assert bpy.ops.halfspace.measure_levels() == {"FINISHED"}
    found = levels.known(seen)
    assert found.beside.rays is found.rays
    both = found.levels.levels, found.beside.levels.levels
    for key, title, number in (
        ("SAH", "Level, SAH", lambda level: level.sah_share),
        ("OVERLAP", "Level, EPO", lambda level: level.overlap),
        ("TIME", "Level, ns, fitted", lambda level: level.fitted_nanoseconds),
    ):
        seen.halfspace.inspector.column = key
        texts = draw(inspector_panels.HALFSPACE_PT_view_levels, scene=seen)
        rows = texts[texts.index(title) :][:3], texts[texts.index(title) + 3 :]
        assert rows[0][1:] == ["kd", "bvh-sah"]
        assert rows[1][0::3][: len(both[0])] == [str(level) for level in range(max(map(len, both)))][: len(both[0])]
        for column, tree in enumerate(both):
            for level, text in zip(tree, rows[1][1 + column :: 3], strict=False):
                wanted = number(level)
                shown = "–" if wanted is None else text.rstrip("%")
                assert (
                    text == "–"
                    if wanted is None
                    else float(shown) == pytest.approx(100 * wanted if key == "SAH" else wanted, abs=0.06, rel=0.01)
                )
    # Without the second one all numbers of the first are shown.
    seen.halfspace.second = "NONE"
    texts = draw(inspector_panels.HALFSPACE_PT_view_levels, scene=seen)
    assert "ns, fitted" in texts
    assert "bvh-sah" not in texts


def test_times_that_do_not_fit_are_not_shown(seen: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    build(seen, "kd")
    prices = measuring.Prices(1.0, 1.0, 300.0, measuring.LEAST_EXPLAINED - 0.01, ((0.5, 1.5), (0.5, 1.5)))
    monkeypatch.setattr(measuring, "_prices", lambda *_: prices)
    bpy.ops.halfspace.measure_levels()
    found = levels.known(seen)
    assert {level.fitted_nanoseconds for level in found.levels.levels} == {None}
    texts = draw(inspector_panels.HALFSPACE_PT_view_levels, scene=seen)
    assert texts.count("–") == len(found.levels.levels)
    assert "No time per level" in " ".join(texts)


def test_every_child_can_be_reached(seen: Any) -> None:
    tree = build(seen, "grid")
    bpy.ops.halfspace.go_to_node(to="ROOT")
    settings = seen.halfspace.inspector
    children = tree.table().children_of(0)
    assert len(children) > inspector_panels.MOST_CHILDREN
    reached = []
    pages = -(-len(children) // inspector_panels.MOST_CHILDREN)
    for page in range(1, pages + 1):
        settings.page = page
        buttons = draw_all(inspector_panels.HALFSPACE_PT_view_tree, scene=seen).operators
        reached += [button.index for button in buttons if getattr(button, "to", "") == "CHILD"]
    assert reached == list(range(len(children)))
    # A page beyond the last shows the last; another node begins with its first page.
    settings.page = 10**6
    assert f"Children {8 * (pages - 1) + 1:,} to {len(children):,} of {len(children):,}" in draw(
        inspector_panels.HALFSPACE_PT_view_tree, scene=seen
    )
    assert bpy.ops.halfspace.go_to_node(to="CHILD", index=len(children) - 1) == {"FINISHED"}
    assert settings.node == children[-1]
    assert settings.page == 1


def test_histograms_stand_over_the_sliders(seen: Any) -> None:
    seen.halfspace.cost, seen.halfspace.second = "TESTS", "bvh-sah"
    build(seen, "kd")
    bpy.ops.halfspace.cost_map(width=64)
    draw(inspector_panels.HALFSPACE_PT_image_maps, scene=seen)
    (kept,) = cost_maps.KEPT.all()
    icons = histogram_icons._icons
    side = histogram_icons.SIDE
    before = np.empty((side, side, 4), np.float32)
    for number, (_, values) in enumerate(kept.maps):
        icons[f"map {number}"].image_pixels_float.foreach_get(before.reshape(-1))
        # The fullest bin reaches to the top.
        shares = (before[..., :3].max(axis=2) > 0.15).mean(axis=0)
        end = cost_maps.costmap.scale_end([one for _, one in kept.maps])
        fullest = np.bincount(np.clip((values.ravel() / end * 64).astype(int), 0, 63), minlength=64).argmax()
        assert int(shares[1:-1].argmax() + 1) // (side // 64) == fullest
    ranges = kept.ranges(seen)
    ranges[1].low = 50.0
    draw(inspector_panels.HALFSPACE_PT_image_maps, scene=seen)
    after_range = np.empty((side, side, 4), np.float32)
    icons["map 1"].image_pixels_float.foreach_get(after_range.reshape(-1))
    assert np.ptp(after_range[:, 1 : side // 2 - 1, :3], axis=2).max() < 0.01
    assert np.ptp(after_range[:, side // 2 + 2 :, :3], axis=2).max() > 0.1
