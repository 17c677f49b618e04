# SPDX-License-Identifier: GPL-3.0-or-later
"""A 3D view reads again only what an edit has changed, and shows the same as a view that reads everything."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.read import extract, object_meshes
from addon.blender.read.remembered import Remembered
from addon.blender.read.strands import sources
from addon.blender.read.value_nodes.outputs import Wanted
from addon.blender.render import viewport
from addon.core.base.equality import same
from addon.core.base.notes import Notes
from addon.core.scene import tubes
from tests.blender.shapes import cube, grid, material, node


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Things read from Blender and made of them since the last `clear`."""
    done: list[str] = []

    def count(module: Any, name: str) -> None:
        original = getattr(module, name)

        def called(*parts: Any, **named: Any) -> Any:
            done.append(name)
            return original(*parts, **named)

        monkeypatch.setattr(module, name, called)

    for module, name in ((object_meshes, "read_mesh"), (sources, "read_curves"), (tubes, "tubes")):
        count(module, name)
    return done


@pytest.fixture
def objects(add: Any) -> dict[str, Any]:
    """Meshes with and without a modifier, one mesh twice, a curve object, hair, and what instances a mesh."""
    shared = cube("Shared")
    made = {
        "Plain": add("Plain", grid(3, "Plain")),
        "Smoothed": add("Smoothed", grid(3, "Smoothed"), location=(3, 0, 0)),
        "First": add("First", shared, location=(0, 3, 0)),
        "Second": add("Second", shared, location=(0, 6, 0)),
    }
    made["Smoothed"].modifiers.new("Smooth", "SUBSURF").levels = 1
    text = bpy.data.curves.new("Text", "FONT")
    text.body = "A"
    made["Text"] = add("Text", text, location=(6, 0, 0))
    hair = bpy.data.hair_curves.new("Hair")
    hair.add_curves([4] * 5)
    along = np.linspace(0, 1, 4)
    points = np.stack([np.stack([np.full(4, i / 5), along**2, along], axis=1) for i in range(5)])
    hair.position_data.foreach_set("vector", points.astype(np.float32).reshape(-1))
    made["Hair"] = add("Hair", hair, location=(-3, 0, 0))
    made["Instancer"] = add("Instancer", grid(2, "Places"), location=(0, -5, 0))
    made["Instancer"].instance_type = "VERTS"
    made["Leaf"] = add("Leaf", cube("Leaf", 0.2))
    made["Leaf"].parent = made["Instancer"]
    return made


class Evaluated:
    """The depsgraph as a 3D view gets it: outside of handlers its list of updates is empty."""

    def __init__(self) -> None:
        self.updates: list[Any] = []
        bpy.app.handlers.depsgraph_update_post.append(self._collect)

    def __getattr__(self, name: str) -> Any:
        return getattr(bpy.context.evaluated_depsgraph_get(), name)

    def _collect(self, _scene: Any, depsgraph: Any) -> None:
        for one in depsgraph.updates:
            block = SimpleNamespace(original=SimpleNamespace(session_uid=one.id.original.session_uid))
            self.updates.append(SimpleNamespace(id=block, is_updated_geometry=one.is_updated_geometry))

    def close(self) -> None:
        bpy.app.handlers.depsgraph_update_post.remove(self._collect)


@pytest.fixture
def evaluated() -> Iterator[Evaluated]:
    made = Evaluated()
    yield made
    made.close()


def read(evaluated: Evaluated, remembered: Remembered | None) -> tuple[Any, list[str]]:
    """The scene as a view reads it, and its notes."""
    notes = Notes()
    found = extract.find(evaluated, notes, wanted=Wanted(remembered=remembered))
    if remembered is not None:
        evaluated.updates.clear()
    return found.flattened(), [*notes.lines(), *found.made]


def test_a_move_reads_nothing_again(objects: dict[str, Any], evaluated: Evaluated, counted: list[str]) -> None:
    view = Remembered()
    read(evaluated, view)
    assert counted.count("read_mesh") == 7
    assert counted.count("read_curves") == 1
    counted.clear()
    for item in objects.values():
        item.location.x += 0.01
    bpy.context.view_layer.update()
    assert same(read(evaluated, view), read(evaluated, None))
    # All that was read is for the second, which remembers nothing.
    assert counted.count("read_mesh") == 7
    assert counted.count("read_curves") == counted.count("tubes") == 1


def test_an_edit_of_a_mesh_reads_that_mesh(objects: dict[str, Any], evaluated: Evaluated, counted: list[str]) -> None:
    view = Remembered()
    read(evaluated, view)
    counted.clear()
    objects["First"].data.vertices[0].co.z += 1
    objects["First"].data.update()
    bpy.context.view_layer.update()
    kept = read(evaluated, view)
    assert counted == ["read_mesh"]
    assert same(kept, read(evaluated, None))


def subdivide(objects: dict[str, Any]) -> None:
    objects["Smoothed"].modifiers[0].levels += 1


def hang(objects: dict[str, Any]) -> None:
    objects["Hair"].data.position_data[3].vector.z += 0.5
    objects["Hair"].data.update_tag()


def write(objects: dict[str, Any]) -> None:
    objects["Text"].data.body += "B"


def exchange(objects: dict[str, Any]) -> None:
    objects["Second"].data = cube("Other", 1.0)


def unlink(objects: dict[str, Any]) -> None:
    bpy.data.objects.remove(objects.pop("First"))


def replace(objects: dict[str, Any]) -> None:
    """Remove meshes, and add as many that may have their addresses."""
    for name in [name for name in objects if name.startswith(("Plain", "New"))]:
        bpy.data.meshes.remove(objects.pop(name).data)
    for i in range(3):
        mesh = grid(4 + i, f"New {i}")
        objects[f"New {i}"] = bpy.data.objects.new(f"New {i}", mesh)
        bpy.context.scene.collection.objects.link(objects[f"New {i}"])


def colour(objects: dict[str, Any]) -> None:
    """Let a material read an attribute that one mesh has."""
    mesh = objects["Smoothed"].data
    mesh.color_attributes.new("wear", "FLOAT_COLOR", "POINT")
    shown = material("Worn")
    shader = node(shown.node_tree, "ShaderNodeBsdfPrincipled")
    attribute = shown.node_tree.nodes.new("ShaderNodeAttribute")
    attribute.attribute_name = "wear"
    shown.node_tree.links.new(attribute.outputs["Color"], shader.inputs["Base Color"])
    mesh.materials.append(shown)


def rename(objects: dict[str, Any]) -> None:
    objects["Hair"].name = "Fur"


def hide(objects: dict[str, Any]) -> None:
    objects["Leaf"].hide_viewport = not objects["Leaf"].hide_viewport


def edit_mode(objects: dict[str, Any]) -> None:
    bpy.context.view_layer.objects.active = objects["Second"]
    bpy.ops.object.mode_set(mode="EDIT" if objects["Second"].mode == "OBJECT" else "OBJECT")


EDITS = (subdivide, hang, write, exchange, unlink, replace, colour, rename, hide, edit_mode)


@pytest.mark.parametrize("seed", range(6))
def test_any_edits_show_what_a_new_view_shows(objects: dict[str, Any], evaluated: Evaluated, seed: int) -> None:
    view = Remembered()
    rng = np.random.default_rng(seed)
    edits: list[Callable[[dict[str, Any]], None]] = [*EDITS, hide, replace, subdivide, replace]
    read(evaluated, view)
    for number in rng.permutation(len(edits)):
        edits[number](objects)
        bpy.context.view_layer.update()
        kept, fresh = read(evaluated, view), read(evaluated, None)
        assert same(kept, fresh), edits[number].__name__


def layered(objects: dict[str, Any]) -> None:
    """Let a material read what costs steps of its own: attributes, normals, an image, what hair has along it."""
    shown = material("Layered")
    tree = shown.node_tree
    shader = node(tree, "ShaderNodeBsdfPrincipled")
    picture, hair = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeHairInfo")
    picture.image = bpy.data.images.new("Picture", 4, 4)
    tree.links.new(picture.outputs["Color"], shader.inputs["Base Color"])
    tree.links.new(hair.outputs["Intercept"], shader.inputs["Roughness"])
    for name in ("Plain", "Hair"):
        objects[name].data.materials.append(shown)
    objects["Plain"].data.uv_layers.new(name="Map")
    objects["Plain"].data.polygons.foreach_set("use_smooth", [True] * len(objects["Plain"].data.polygons))
    bpy.context.view_layer.update()


def test_reading_in_steps_is_reading_at_once(objects: dict[str, Any], evaluated: Evaluated) -> None:
    layered(objects)
    reading = extract.Reading(evaluated, Notes(), wanted=Wanted(remembered=Remembered()))
    steps = 1
    while not reading.advance(0.0):
        steps += 1
    assert steps > 4 * len(objects), "a step is no more than an attribute"
    assert same(reading.found().flattened(), read(evaluated, None)[0])


@pytest.mark.parametrize("steps", [0, 1, 9, 20, 40, 60])
def test_a_reading_that_is_broken_off_loses_no_edit(
    objects: dict[str, Any], evaluated: Evaluated, counted: list[str], steps: int
) -> None:
    layered(objects)
    view = Remembered()
    read(evaluated, view)
    edits: list[Callable[[dict[str, Any]], None]] = [subdivide, hang, exchange, replace, rename, unlink, write]
    for edit in edits:
        edit(objects)
        bpy.context.view_layer.update()
        reading = extract.Reading(evaluated, Notes(), wanted=Wanted(remembered=view))
        evaluated.updates.clear()
        for _ in range(steps):
            reading.advance(0.0)
        reading.close()
    objects["Hair"].location.x += 1
    bpy.context.view_layer.update()
    assert same(read(evaluated, view), read(evaluated, None))


def test_a_reading_that_is_broken_off_keeps_what_it_read(
    objects: dict[str, Any], evaluated: Evaluated, counted: list[str]
) -> None:
    view = Remembered()
    reading = extract.Reading(evaluated, Notes(), wanted=Wanted(remembered=view))
    evaluated.updates.clear()
    while counted.count("read_mesh") < 4:
        reading.advance(0.0)
    reading.close()
    assert same(read(evaluated, view), read(evaluated, None))
    # The last mesh was not finished, and the second scene remembers nothing.
    assert counted.count("read_mesh") == 7 + 1 + 7


def test_a_view_that_failed_reads_everything_again(
    objects: dict[str, Any], evaluated: Evaluated, monkeypatch: pytest.MonkeyPatch
) -> None:
    view = viewport.Viewport()
    before = view._remembered
    monkeypatch.setattr(extract.Reading, "advance", lambda *_: pytest.fail("a material cannot be read"))
    view.update(SimpleNamespace(), SimpleNamespace(space_data=None), evaluated)
    assert view._problem.endswith("a material cannot be read")
    assert view._remembered is not before
