# SPDX-License-Identifier: GPL-3.0-or-later
"""Scene settings come from the registry and follow the chosen structure."""

import zlib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import halfspace_native
import pytest

from addon.blender.measure import cost_maps
from addon.blender.render.viewport import Viewport
from addon.blender.session import reports
from addon.blender.settings import properties
from addon.blender.ui import compare_panels, overlay_panels, panels, structure, texts
from addon.core.base import native
from addon.core.structures import catalogue, relevance
from addon.core.structures.catalogue import Parameter, Structure
from tests.blender import atlas
from tests.blender.layouts import Layout, draw, draw_all
from tests.blender.shapes import cube, look, reopened
from tests.blender.viewing import settle


def test_enum_numbers_are_the_registrys_codes(scene: Any) -> None:
    items = scene.halfspace.bl_rna.properties["structure"].enum_items
    assert {item.identifier: item.value for item in items} == {
        row["id"]: row["code"] for row in halfspace_native.structures()
    }
    assert scene.halfspace.structure == "kd"


def test_structures_compared_by_default_exist(scene: Any) -> None:
    items = scene.halfspace.bl_rna.properties["structure"].enum_items
    assert set(properties.TICKED) <= {item.identifier for item in items}


def test_every_structure_has_a_property_for_each_parameter_with_its_default(scene: Any) -> None:
    for row in halfspace_native.structures():
        scene.halfspace.structure = row["id"]
        for parameter in row["parameters"]:
            value = getattr(scene.halfspace, parameter["name"])
            assert value == (
                pytest.approx(parameter["default"]) if parameter["kind"] == "float" else parameter["default"]
            )
        assert properties.spec(scene.halfspace) == row["id"]
        names = [parameter.name for parameter in properties.structure_parameters(scene.halfspace)]
        assert names == [parameter["name"] for parameter in row["parameters"]]


def test_a_value_that_the_user_set_survives_a_change_of_structure(scene: Any) -> None:
    scene.halfspace.traversal = "sung"
    scene.halfspace.structure = "kd-sah"
    assert properties.spec(scene.halfspace) == "kd-sah:traversal=sung"
    scene.halfspace.structure = "brute"
    scene.halfspace.structure = "kd"
    assert properties.spec(scene.halfspace) == "kd:traversal=sung"


def test_settings_survive_saving_and_loading(tmp_path: Path, scene: Any) -> None:
    scene.halfspace.structure = "kd-sah"
    scene.halfspace.samples = 7
    scene.view_layers[0].halfspace.use_pass_steps = True
    loaded = reopened(tmp_path / "settings.blend")
    assert (loaded.halfspace.structure, loaded.halfspace.samples) == ("kd-sah", 7)
    assert loaded.view_layers[0].halfspace.use_pass_steps


class Engine:
    """Nothing of an engine is needed until its view is drawn."""


def store(scene: Any, name: str, value: int) -> None:
    """Give a setting a number that it cannot be given, as a file of another version may."""
    setattr(scene.halfspace, name, scene.halfspace.bl_rna.properties[name].enum_items[0].identifier)
    stored = scene.bl_system_properties_get() if hasattr(scene, "bl_system_properties_get") else scene
    stored["halfspace"][name] = value


def test_a_structure_of_another_version_is_said_and_replaced(scene: Any, add: Any) -> None:
    add("Cube", cube())
    look((8, 8), (0, 0, 9))
    scene.render.engine, scene.halfspace.samples = "HALFSPACE", 1
    store(scene, "structure", 9999)
    store(scene, "second", 9999)
    assert scene.halfspace.structure == scene.halfspace.second == ""
    assert properties.spec(scene.halfspace) == "kd"
    bpy.ops.render.render()
    assert f"{properties.UNKNOWN}: kd-tree" in atlas.warnings(scene)
    assert bpy.ops.halfspace.build_structure() == {"FINISHED"}
    assert bpy.ops.halfspace.check() == {"FINISHED"}
    assert bpy.ops.halfspace.cost_map(width=8) == {"FINISHED"}
    told: list[str] = []
    cost_maps.draw(scene, 8, told.append)
    assert told.count(f"{properties.UNKNOWN}: kd-tree") == 1
    view = Viewport()
    view.update(Engine(), SimpleNamespace(space_data=None), bpy.context.evaluated_depsgraph_get())
    settle(view)
    assert f"{properties.UNKNOWN}: kd-tree" in view.status()
    assert "max_depth" in draw(overlay_panels.HALFSPACE_PT_view_structure, scene=scene)


def shown_as(parameter: Parameter) -> str:
    """The name of the property or the menu that shows a parameter."""
    if parameter.is_switch:
        return properties.switch(parameter.name)
    return structure.menu_of(parameter.name) if parameter.kind == "choice" else parameter.name


def drawn_parameters(scene: Any) -> list[str]:
    """The items that the panel draws between the choice of the structure and its source."""
    chosen = properties.structure(scene.halfspace)
    every = {shown_as(parameter) for parameter in chosen.parameters}
    return [name for name in draw(overlay_panels.HALFSPACE_PT_view_structure, scene=scene) if name in every]


@pytest.mark.parametrize("one", catalogue.load().structures, ids=lambda one: one.id)
def test_the_structure_panel_shows_what_has_an_effect_and_nothing_else(scene: Any, one: Structure) -> None:
    group = scene.halfspace
    group.structure = one.id
    contexts: list[dict[str, Any]] = [{}]
    if one.parameter("costs") is not None:
        contexts.append({"costs": "thesis"})
    for context in contexts:
        for name, value in context.items():
            setattr(group, name, value)
        values = properties.values(group)
        grouped = relevance.grouped(one, values)
        expected = [shown_as(parameter) for key in relevance.GROUPS for parameter in grouped[key]]
        assert drawn_parameters(scene) == expected
        assert set(expected) == {shown_as(parameter) for parameter in relevance.relevant(one, values)}
        drawn = draw(overlay_panels.HALFSPACE_PT_view_structure, scene=scene)
        assert one.paper.replace(" ", "") in "".join(drawn).replace(" ", "")
    drawn = draw(panels.HALFSPACE_PT_structure, scene=scene)
    assert drawn[:2] == ["automatic", "structure"]
    assert drawn[-2:] == ["instancing", "memory_limit"]
    assert not set(drawn) & {shown_as(parameter) for parameter in one.parameters}, "parameters are in the sidebar"


def test_the_tree_over_instances_is_chosen_where_they_are_kept(scene: Any) -> None:
    group, kinds = scene.halfspace, (panels.HALFSPACE_PT_structure, compare_panels.HALFSPACE_PT_view_compare)
    for mode, kept, shown in (
        ("auto", None, False),
        ("auto", False, False),
        ("auto", True, True),
        ("flatten", True, False),
        ("two-level", None, True),
    ):
        group.instancing = mode
        reports.KEPT.keep(scene, kept)
        for kind in kinds:
            assert ("top" in draw(kind, scene=scene)) == shown, (mode, kept, kind)


def test_k_and_alpha_come_first_and_the_rest_is_closed(scene: Any) -> None:
    scene.halfspace.structure = "bsp-wn-plus-kd"
    layout = draw_all(overlay_panels.HALFSPACE_PT_view_structure, scene=scene)
    known = {parameter.name for parameter in properties.structure_parameters(scene.halfspace)}
    numbers = [name for name in layout.log if name in known]
    assert numbers[:2] == ["k", "alpha"]
    assert layout.parts == ["HALFSPACE_builder", "HALFSPACE_costs", "HALFSPACE_numerics", "HALFSPACE_source"]
    assert "Costs" in layout.log
    scene.halfspace.leaf_cost = 9.0
    scene.halfspace.enough = 0.3
    assert "Costs, 2 changed" in draw(overlay_panels.HALFSPACE_PT_view_structure, scene=scene)


def test_a_switch_is_a_check_box_over_the_stored_choice(scene: Any) -> None:
    group = scene.halfspace
    group.structure = "bsp-wn-plus-kd"
    assert group.use_clip
    group.use_clip = False
    assert group.clip == "0"
    assert properties.spec(group) == "bsp-wn-plus-kd:clip=0"
    group.clip = "1"  # as presets and scripts write it
    assert group.use_clip
    switches = [p for p in catalogue.load().parameters().values() if set(p.options) == {"0", "1"}]
    assert len(switches) >= 4
    for parameter in switches:
        assert isinstance(getattr(group, f"use_{parameter.name}"), bool)


@pytest.mark.parametrize(("choice", "on"), [("0", False), ("1", True)])
def test_switches_of_files_that_stored_a_choice_are_read(tmp_path: Path, scene: Any, choice: str, *, on: bool) -> None:
    """Files store the number of a choice, which is made from its name; both numbers are far from 0 and 1."""
    number = zlib.crc32(choice.encode()) & 0x7FFF_FFFF
    scene.halfspace.structure = "bsp-wn-plus-kd"
    for name in ("clip", "early"):
        store(scene, name, number)
    group = reopened(tmp_path / "switches.blend").halfspace
    assert (group.use_clip, group.use_early) == (on, on)
    assert properties.spec(group) == ("bsp-wn-plus-kd:early=1" if on else "bsp-wn-plus-kd:clip=0")


def test_menus_offer_only_what_is_valid_here(scene: Any) -> None:
    group = scene.halfspace
    group.structure = "bvh-sah"
    group.traversal = "flight"
    wide = choices(scene, "traversal")
    assert "flight" in wide
    assert not {"sung", "ta-b"} & set(wide), "those of other structures"
    group.width = "2"
    narrow = choices(scene, "traversal")
    assert {"auto", "ordered", "stream"} < set(narrow) < set(wide) - {"flight"}
    assert properties.spec(group) == "bvh-sah:width=2"
    group.width = "8"
    assert choices(scene, "traversal") == wide
    assert properties.spec(group) == "bvh-sah:traversal=flight", "the choice comes back with the nodes"
    group.structure = "bih"
    assert choices(scene, "shadow") == ["none", "cache"]
    group.structure = "kd"
    assert choices(scene, "shadow") == ["none", "cache", "beam"]


def choices(scene: Any, name: str) -> list[str]:
    """The options in the menu of a choice."""
    return draw(getattr(bpy.types, structure.menu_of(name)), scene=scene)


LABEL, VALUE, WHOLE = 100, 88, 186
"""Pixels of labels, of values next to the arrow of a menu, and of a whole row next to it, at the default width."""


def test_no_label_is_cut_at_the_default_width() -> None:
    known = catalogue.load()
    wide: list[tuple[str, int]] = []
    for one in known.structures:
        wide.append((one.label, WHOLE))
        for parameter in one.parameters:
            wide.append((parameter.label, LABEL))
            if not parameter.is_switch:
                wide += [(parameter.label_of(option), VALUE) for option in parameter.options]
    wide += [(label, VALUE) for label in (*structure.NODES.values(), *structure.RAYS.values())]
    assert [text for text, room in wide if texts.wide(text) > room] == []
    assert texts.wide("Interval hierarchy traversed as boxes") > WHOLE, "the letters have a width"


def test_texts_are_broken_by_their_width() -> None:
    layout = Layout()
    text = "Wächter and Keller 2006, Instant ray tracing: the bounding interval hierarchy; Ooi, McDonell " * 3
    texts.wrapped(layout, text, icon="BOOKMARKS")
    assert " ".join(layout.log) == text.strip()
    room = texts.NARROW - texts.MARGINS - texts.ICON
    assert all(texts.wide(line) <= room for line in layout.log)
    assert all(texts.wide(f"{line} interval") > room - 60 for line in layout.log[:-1]), "the lines are full"
    # A specification has no blanks.
    layout, text = Layout(), "bsp-cn-plus-kd:k=6,alpha=0.5,nodes=wide,traversal=stream,shadow=cache,early=1"
    texts.wrapped(layout, text)
    assert "".join(layout.log) == text
    assert len(layout.log) > 1
    assert all(texts.wide(line) <= texts.NARROW - texts.MARGINS for line in layout.log)


def test_the_structure_panel_says_why_there_is_no_native_module(scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "problem", lambda: "The native module of Halfspace cannot be loaded: gone " * 3)
    lines = draw(panels.HALFSPACE_PT_structure, scene=scene)
    assert len(lines) > 1
    assert "cannot be loaded" in " ".join(lines)


def test_without_a_picture_there_are_no_statistics(scene: Any) -> None:
    assert draw(panels.HALFSPACE_PT_statistics, scene=scene) == ["Nothing rendered yet"]


def test_tooltips_are_sentences(scene: Any) -> None:
    properties_of = scene.halfspace.bl_rna.properties
    told = [item.description for item in properties_of["structure"].enum_items]
    told += [item.description for item in properties_of["second"].enum_items]
    told += [tick.description for tick in scene.halfspace.compared.bl_rna.properties]
    assert len(told) > 80
    # Blender itself puts a full stop at the end.
    assert [text for text in told if ".." in text or text.endswith(".")] == []
    assert any(". Wald and Havran 2006" in text for text in told)
