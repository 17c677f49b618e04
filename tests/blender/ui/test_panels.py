# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels read and never work; presets, help and the check of a structure."""

import dataclasses
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.measure import checking
from addon.blender.read import extract
from addon.blender.session import building, trees
from addon.blender.settings import presets, properties
from addon.blender.ui import (
    bake_panels,
    compare_panels,
    data_panels,
    inspector_panels,
    manual,
    overlay_panels,
    panels,
    pass_panels,
    sidebar,
    texts,
)
from addon.core.base import native
from addon.core.overlay import planes
from addon.core.structures import catalogue, specs
from addon.core.structures.presets import offered
from tests.blender.layouts import Layout, draw, draw_all, draw_own
from tests.blender.shapes import cube, sphere

PANELS = [
    *panels.CLASSES,
    *data_panels.CLASSES,
    *pass_panels.CLASSES,
    *bake_panels.CLASSES,
    *overlay_panels.CLASSES,
    *inspector_panels.CLASSES,
    *compare_panels.CLASSES,
]


def context(scene: Any) -> dict[str, Any]:
    light = bpy.data.lights.new("Light", "SPOT")
    world = bpy.data.worlds.new("World")
    item = bpy.data.objects.new("Item", cube())
    camera = bpy.data.cameras.new("Dome")
    camera.type = "PANO"
    return {
        "scene": scene,
        "view_layer": scene.view_layers[0],
        "light": light,
        "camera": camera,
        "world": world,
        "object": item,
        "material": bpy.data.materials.new("Material"),
        "engine": "HALFSPACE",
    }


@pytest.mark.parametrize("panel", PANELS, ids=lambda panel: panel.__name__)
def test_drawing_a_panel_neither_builds_nor_measures(
    scene: Any, add: Any, panel: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    add("Box", cube())
    scene.halfspace.overlay.show = True
    scene.halfspace.overlay.auto_update = False
    assert bpy.ops.halfspace.build_structure() == {"FINISHED"}
    assert bpy.ops.halfspace.check() == {"FINISHED"}
    tree = trees.last(scene)
    assert tree is not None
    catalogue.load()

    def work(*_args: Any, **_kwargs: Any) -> None:
        pytest.fail("a panel does work")

    # The registry may be read.
    registry = SimpleNamespace(effective=native.load().effective, options=native.load().options)
    tree.structure = SimpleNamespace(statistics=tree.structure.statistics, spec=tree.spec)
    for module, name in ((extract, "find"), (building, "Job")):
        monkeypatch.setattr(module, name, work)
    monkeypatch.setattr(native, "load", lambda: registry)
    monkeypatch.setattr(native, "problem", lambda: None)
    draw_all(panel, **context(scene))


def test_statistics_show_every_number_and_the_check(scene: Any, add: Any) -> None:
    add("Box", cube())
    shown = overlay_panels.HALFSPACE_PT_view_statistics
    assert "Leaves" not in draw(shown, scene=scene)
    assert bpy.ops.halfspace.check() == {"FINISHED"}
    text = draw(shown, scene=scene)
    for label in ("Build", "Memory", "Refs per triangle", "Depth, largest", "Expected cost", "primary"):
        assert label in text
    verdict = re.search(r"([\d,]+) answers of .* are those of brute force, bit for bit", " ".join(text))
    assert int(verdict[1].replace(",", "")) > 100
    bpy.ops.halfspace.build_structure()
    assert "primary" not in draw(shown, scene=scene)  # another structure: nothing is known of it yet


def test_a_structure_that_errs_is_shown_as_such(scene: Any, add: Any) -> None:
    add("Box", cube())
    bpy.ops.halfspace.check()
    tree = trees.last(scene)
    found = tree.check
    assert found.right
    # Five that differ, of which two are right but for the last bit of their distance.
    wrong = dataclasses.replace(found.errors, false_miss=3, wrong=5)
    tree.check = dataclasses.replace(found, errors=wrong)
    assert checking.words(tree) == f"{found.errors.rays:,} answers compared, some WRONG"
    (built,) = (line for line in draw(overlay_panels.HALFSPACE_PT_view_structure, scene=scene) if "Built in" in line)
    assert built.endswith("some WRONG")
    text = " ".join(draw(overlay_panels.HALFSPACE_PT_view_statistics, scene=scene))
    assert "5 of" in text
    assert "3 hits lost" in text
    assert "the others in t, u or v" in text


def test_every_preset_gives_its_configuration(scene: Any) -> None:
    known = offered(catalogue.load())
    assert len(known) > 50
    assert {specs.structure_of(one.spec) for one in known} == {one.id for one in catalogue.load().structures}
    scene.halfspace.structure = "kd"
    scene.halfspace.step_cost = 0.3
    for preset in known:
        assert bpy.ops.halfspace.use_spec(spec=preset.spec) == {"FINISHED"}
        nothing = np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32)
        assert properties.spec(scene.halfspace) == native.load().build(*nothing, preset.spec).spec
    # Other names choose what they stand for.
    bpy.ops.halfspace.use_spec(spec="bih4:leaf_size=2")
    assert properties.spec(scene.halfspace) == "bih-n:n=2,leaf_size=2"
    with pytest.raises(RuntimeError, match="unknown structure"):
        bpy.ops.halfspace.use_spec(spec="no-such")


def test_the_preset_menu_lists_names_of_the_sources_and_saves_the_users_own(
    scene: Any,
) -> None:
    menu = SimpleNamespace(layout=Layout(), draw_preset=lambda _context: None)
    presets.HALFSPACE_MT_presets.draw(menu, None)
    assert not menu.layout.operators
    families = [draw_all(getattr(bpy.types, name)).operators for name in menu.layout.menus]
    listed = [button.spec for buttons in families for button in buttons]
    assert sorted(listed) == sorted(preset.spec for preset in offered(catalogue.load()))
    assert all(1 < len(buttons) <= 20 for buttons in families), "no menu is longer than the screen"
    scene.halfspace.structure = "kd"
    scene.halfspace.step_cost = 0.75
    assert bpy.ops.halfspace.preset_add(name="mine") == {"FINISHED"}
    path = bpy.utils.preset_find("mine", "halfspace/structure")
    assert path
    try:
        scene.halfspace.structure = "bvh-sah"
        scene.halfspace.step_cost = 3.0
        bpy.ops.script.execute_preset(filepath=path, menu_idname="HALFSPACE_MT_presets")
        assert properties.spec(scene.halfspace) == "kd:step_cost=0.75"
    finally:
        Path(path).unlink()


PARTS = {part.key: part for part in presets.PICTURES}


@pytest.mark.parametrize("key", PARTS)
def test_presets_of_pictures_are_offered_saved_and_used(scene: Any, key: str) -> None:
    part, group = PARTS[key], scene.halfspace
    listed = Layout()
    menu = SimpleNamespace(layout=listed, part=part, path_menu=lambda *_args, **_rest: None)
    menu.preset_subdir, menu.preset_operator, menu.preset_add_operator = f"halfspace/{key}", "script.execute_preset", ""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(presets.PresetPanel, "draw", lambda _panel, _context: None)
        panel = type("Panel", (presets._PicturePresets,), {"layout": listed, "part": part})
        panel().draw(None)
    assert [(button.part, button.preset) for button in listed.operators] == [(key, name) for name in part.offered]
    for name, values in part.offered.items():
        assert set(values) <= set(part.names)
        assert bpy.ops.halfspace.use_picture_preset(part=key, preset=name) == {"FINISHED"}
        assert {one: getattr(group, one) for one in values} == pytest.approx(values)
    # The user's own hold all values.
    before = {name: getattr(group, name) for name in part.names}
    assert getattr(bpy.ops.halfspace, f"{key}_preset_add")(name="mine") == {"FINISHED"}
    path = bpy.utils.preset_find("mine", f"halfspace/{key}")
    assert path
    try:
        for name, value in before.items():
            setattr(group, name, not value if isinstance(value, bool) else value + 1)
        bpy.ops.script.execute_preset(filepath=path, menu_idname=f"HALFSPACE_PT_{key}_presets")
        assert {name: getattr(group, name) for name in part.names} == pytest.approx(before)
    finally:
        Path(path).unlink()
    with pytest.raises(RuntimeError, match=f"no preset other of {key}"):
        bpy.ops.halfspace.use_picture_preset(part=key, preset="other")


@pytest.mark.parametrize("engine", ["HALFSPACE", "CYCLES"])
def test_structure_statistics_and_compare_are_drawn_once(scene: Any, engine: str) -> None:
    where = SimpleNamespace(**{**context(scene), "engine": engine})
    shown = [panel for panel in PANELS if panel.poll(where) and not getattr(panel, "bl_parent_id", "")]
    sidebar = [panel.bl_label for panel in shown if panel.bl_region_type == "UI" and panel.bl_space_type == "VIEW_3D"]
    assert sidebar[:2] == ["Overlay", "Structure"]
    titles = [panel.bl_label for panel in shown if panel.bl_label in ("Statistics", "Compare")]
    assert sorted(titles) == ["Compare", "Statistics"]
    # The parameters of the structure are in one panel.
    scene.halfspace.structure = "bsp-wn-plus-kd"
    owners = [panel.__name__ for panel in shown if "alpha" in draw(panel, **vars(where))]
    assert owners == ["HALFSPACE_PT_view_structure"]


@pytest.mark.parametrize(
    ("panel", "moves"),
    [
        (panels.HALFSPACE_PT_sampling_render, False),  # as in Cycles
        (panels.HALFSPACE_PT_sampling_advanced, True),
        (panels.HALFSPACE_PT_light_paths, True),
        (panels.HALFSPACE_PT_film, True),
        (data_panels.HALFSPACE_PT_light, True),
        (data_panels.HALFSPACE_PT_visibility, True),
        (panels.HALFSPACE_PT_structure, False),
    ],
)
def test_settings_that_move_have_dots(scene: Any, panel: Any, *, moves: bool) -> None:
    assert draw_own(panel, SimpleNamespace(**context(scene))).use_property_decorate == moves


@pytest.mark.parametrize("panel", [one for one in PANELS if one.bl_space_type == "PROPERTIES"])
def test_buttons_are_not_cut_off_where_the_properties_are_narrow(scene: Any, panel: Any) -> None:
    for button in draw_own(panel, SimpleNamespace(**context(scene))).operators:
        room, name = button.id.split(".")
        text = getattr(getattr(bpy.ops, room), name).get_rna_type().name if button.text is None else button.text
        assert texts.wide(text) <= texts.NARROW - texts.MARGINS - texts.ICON, text


def test_the_overlay_lists_kinds_once_there_is_a_structure_and_folds_its_look(scene: Any, add: Any) -> None:
    where = {**context(scene), "area": None}
    before = draw(overlay_panels.HALFSPACE_PT_view_overlay, **where)
    assert not set(before) & set(planes.KINDS)
    add("Ball", sphere(8))
    scene.halfspace.overlay.auto_update = False
    assert bpy.ops.halfspace.build_structure() == {"FINISHED"}
    trees.last(scene).survey()
    found = draw_own(overlay_panels.HALFSPACE_PT_view_overlay, SimpleNamespace(**where))
    assert {"X", "Y", "Z"} & set(found.log)
    assert found.parts == ["HALFSPACE_look"]


def test_the_overlay_of_a_scene_without_planes_offers_one_with_planes(
    scene: Any, add: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    add("Box", cube())
    scene.halfspace.overlay.auto_update, scene.halfspace.overlay.show = False, True
    assert bpy.ops.halfspace.build_structure() == {"FINISHED"}
    tree = trees.last(scene)
    tree.survey()
    nothing = planes.choose(tree.structure, (0, 6), planes.KINDS, 10)
    monkeypatch.setattr(overlay_panels.drawing, "shown", lambda *_: nothing)
    where = SimpleNamespace(**context(scene), area=None)
    assert "halfspace.showcase" in [
        one.id for one in draw_own(overlay_panels.HALFSPACE_PT_view_overlay, where).operators
    ]
    assert bpy.ops.halfspace.showcase() == {"FINISHED"}
    shown = next(one for one in bpy.data.scenes if one.name.startswith("Showcase"))
    assert shown.halfspace.overlay.show


def test_no_column_of_the_menu_of_structures_is_longer_than_the_screen() -> None:
    families = properties.by_family(catalogue.load().structures)
    assert len(families) > 2
    assert max(len(structures) for structures in families.values()) <= 25


def test_every_panel_that_names_a_section_finds_it(scene: Any) -> None:
    text = manual.manual()
    sections = {panel.section for panel in PANELS if panel.section}
    assert {"Structure", "Statistics"} <= sections
    for section in sections:
        manual.line_of(text, section)
    assert bpy.ops.halfspace.manual(section="Structure") == {"FINISHED"}
    opened = bpy.data.texts[manual.TEXT]
    assert opened.current_line.body == "## Structure"
    with pytest.raises(RuntimeError, match="no-such"):
        bpy.ops.halfspace.manual(section="no-such")
    assert bpy.ops.halfspace.manual() == {"FINISHED"}, "as a search for operators calls it"
    assert opened.current_line.body == "# Manual"


def test_a_marked_screen_opens_its_sidebars_at_the_tab() -> None:
    """A tab exists once its sidebar was drawn: until then the mark stays."""

    class Undrawn:
        type = "UI"

        def __setattr__(self, name: str, _value: str) -> None:
            raise AttributeError(f'bpy_struct: attribute "{name}" from "Region" is read-only')

    drawn = SimpleNamespace(type="UI", active_panel_category="Item")
    for region, category in ((Undrawn(), None), (drawn, "Halfspace")):
        screen = _Screen({sidebar.TAB: True})
        screen.areas = [SimpleNamespace(type="VIEW_3D", regions=[region])]
        assert sidebar.bring_to_front([screen]) == (category is not None)
        assert (sidebar.TAB in screen) == (category is None)
    drawn.active_panel_category = "Item"
    screen = _Screen()
    screen.areas = [SimpleNamespace(type="VIEW_3D", regions=[drawn])]
    assert sidebar.bring_to_front([screen])
    assert drawn.active_panel_category == "Item", "a screen without the mark"


class _Screen(dict[str, bool]):
    """A screen with custom properties."""

    areas: list[SimpleNamespace]
