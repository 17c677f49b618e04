# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights keep their power, size and colour."""

import math
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.read import lights
from addon.core.scene.scene import Light
from tests.blender import atlas
from tests.blender.read_materials import nodes_group
from tests.blender.shapes import node, read, with_nodes


def only_light(add: Any, kind: str, *, scale: tuple[float, float, float] = (1, 1, 1), **settings: Any) -> Light:
    data = bpy.data.lights.new("Light", kind)
    for name, value in settings.items():
        setattr(data, name, value)
    add("Light", data, scale=scale, rotation_euler=(0.1, 0.2, 0.3))
    lights = read()[0].lights
    assert len(lights) == 1
    return lights[0]


def test_power_is_energy_times_colour_times_exposure(add: Any) -> None:
    light = only_light(add, "POINT", energy=10, color=(1, 0.5, 0.25), exposure=2, shadow_soft_size=0.5)
    assert light.power == pytest.approx((40, 20, 10))
    assert (light.kind, light.radius) == ("point", 0.5)


def test_an_error_about_a_light_names_its_object(scene: Any, add: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lights, "_limited", lambda light, _notes: light)
    scene.render.engine = "HALFSPACE"
    add("Camera", bpy.data.cameras.new("Camera"))
    scene.camera = bpy.data.objects["Camera"]
    add("Desk Lamp", bpy.data.lights.new("its data", "POINT")).data.energy = 1e35
    with pytest.raises(RuntimeError, match=r"Desk Lamp: lights\[0\]\['power'\]"):
        bpy.ops.render.render()


def test_temperature_tints(add: Any) -> None:
    light = only_light(add, "SUN", energy=1, use_temperature=True, temperature=3000, angle=0.1)
    r, g, b = light.power
    assert r > g > b > 0
    assert light.angle == pytest.approx(0.1)


def test_spots_have_a_cone(add: Any) -> None:
    light = only_light(add, "SPOT", energy=5, spot_size=1.0, spot_blend=0.25, use_shadow=False)
    assert (light.spot_size, light.spot_blend, light.casts_shadow) == (1.0, 0.25, False)


@pytest.mark.parametrize(
    ("scale", "kept"),
    [
        ((2, 2, 2), (1, 1, 1)),
        ((2, 0.5, 1), (2, 0.5, 1)),
        ((0, 1, 2), (1, 1, 1)),
        # So flat that no cone is left of it.
        ((1, 1e-23, 1e-23), (1, 1, 1)),
        ((1e20, 1e-20, 1), (1, 1, 1)),
    ],
)
def test_uneven_scales_squeeze_the_cone_of_a_spot(
    add: Any, scale: tuple[float, float, float], kept: tuple[float, float, float]
) -> None:
    """As in Cycles; the cone's shape is compared with it in `native/render/src/tests/brightness.rs`."""
    light = only_light(add, "SPOT", energy=5, scale=scale)
    assert np.linalg.norm(light.to_world[:3, :3], axis=0) == pytest.approx(kept)


def test_a_spot_that_hangs_on_something_flat_can_be_rendered(add: Any) -> None:
    """None of its axes is lost by itself, but all three lie in a plane."""
    flat = add("Flat", None, scale=(1, 1, 0))
    spot = add("Light", bpy.data.lights.new("Light", "SPOT"), rotation_euler=(math.pi / 4, 0.2, 0.3))
    spot.parent = flat
    (light,) = read()[0].lights
    assert abs(np.linalg.det(light.to_world[:3, :3])) == pytest.approx(1)


@pytest.mark.parametrize(
    ("shape", "area"), [("SQUARE", 4), ("RECTANGLE", 6), ("DISK", math.pi), ("ELLIPSE", 1.5 * math.pi)]
)
def test_areas_scale_with_their_object_and_need_not_be_normalised(add: Any, shape: str, area: float) -> None:
    light = only_light(add, "AREA", energy=1, shape=shape, size=1, size_y=1.5, normalize=False, scale=(2, 2, 2))
    assert light.size == pytest.approx(2)
    assert light.size_y == pytest.approx(3 if shape in ("RECTANGLE", "ELLIPSE") else 2)
    assert light.power[0] == pytest.approx(area)
    assert np.allclose(np.linalg.norm(light.to_world[:3, :3], axis=0), 1)


@pytest.mark.parametrize(
    ("kind", "settings"),
    [
        ("POINT", {"shadow_soft_size": 0.5}),
        ("POINT", {"shadow_soft_size": 0.0}),
        ("SPOT", {"shadow_soft_size": 0.5}),
        ("SPOT", {"shadow_soft_size": 0.0}),
        ("SUN", {"angle": 0.2}),
        ("SUN", {"angle": 2.5}),
        ("SUN", {"angle": 0.0}),
    ],
)
def test_points_and_suns_need_not_be_normalised(add: Any, kind: str, settings: dict[str, float]) -> None:
    """A sphere shines with all its surface, a sun with its disk of directions: Blender says how large they are."""
    light = only_light(add, kind, energy=2, normalize=False, **settings)
    assert light.power[0] == pytest.approx(2 * bpy.data.lights["Light"].area())


@pytest.mark.parametrize("settings", [{"energy": -2}, {"energy": 1, "strength": -2}])
def test_a_light_of_negative_power_is_kept(add: Any, settings: dict[str, float]) -> None:
    """As in Cycles: it darkens what it shines on."""
    data = bpy.data.lights.new("Anti", "POINT")
    data.energy = settings["energy"]
    with_nodes(data)
    node(data.node_tree, "ShaderNodeEmission").inputs["Strength"].default_value = settings.get("strength", 1)
    add("Anti", data)
    found, notes = read()
    assert notes == []
    (light,) = found.lights
    assert light.power == pytest.approx((-2, -2, -2))


def test_lights_without_power_are_left_out(add: Any) -> None:
    add("Dark", bpy.data.lights.new("Dark", "POINT"))
    bpy.data.lights["Dark"].energy = 0
    assert read()[0].lights == ()


def test_emission_nodes_of_a_light_multiply(add: Any) -> None:
    data = bpy.data.lights.new("Noded", "POINT")
    data.energy = 10
    with_nodes(data)
    emission = node(data.node_tree, "ShaderNodeEmission")
    emission.inputs["Color"].default_value, emission.inputs["Strength"].default_value = (1, 0.5, 0, 1), 2
    add("Noded", data)
    assert read()[0].lights[0].power == pytest.approx((20, 10, 0))
    blackbody = data.node_tree.nodes.new("ShaderNodeBlackbody")
    data.node_tree.links.new(blackbody.outputs[0], emission.inputs["Color"])
    bpy.context.view_layer.update()
    found, notes = read()
    assert notes == []
    (light,) = found.lights
    assert light.power == pytest.approx((10, 10, 10))
    assert [step["op"] for step in light.program[:1]] == ["blackbody"]


@pytest.mark.parametrize(("wall", "expected"), [("Float", 2.126), ("Int", 0), ("Bool", 10), ("Vector", (10, 0, 0))])
def test_a_light_s_colour_takes_the_type_of_its_group_s_socket(add: Any, wall: str, expected: Any) -> None:
    data = bpy.data.lights.new("Grouped", "POINT")
    data.energy = 10
    with_nodes(data)
    tree, group = data.node_tree, nodes_group(wall, wall, lambda _, value: value)
    user, red = atlas.add(tree, "Group", node_tree=group), atlas.add(tree, "RGB")
    red.outputs[0].default_value = (1, 0, 0, 1)
    tree.links.new(red.outputs[0], user.inputs[0])
    tree.links.new(user.outputs[0], node(tree, "ShaderNodeEmission").inputs["Color"])
    add("Grouped", data)
    powers = [light.power for light in read()[0].lights]
    wanted = expected if isinstance(expected, tuple) else (expected,) * 3
    assert powers == ([pytest.approx(wanted)] if any(wanted) else [])


def test_a_portal_gives_no_light(add: Any) -> None:
    data = bpy.data.lights.new("Portal", "AREA")
    if not hasattr(data, "cycles"):
        pytest.skip("this Blender has no Cycles")
    data.cycles.is_portal = True
    add("Portal", data)
    add("Window", bpy.data.lights.new("Window", "AREA"))
    assert len(read()[0].lights) == 1


@pytest.mark.parametrize("kind", ["POINT", "SPOT"])
def test_lights_without_soft_falloff_are_spheres(add: Any, kind: str) -> None:
    data = bpy.data.lights.new("Lamp", kind)
    data.shadow_soft_size, data.use_soft_falloff = 0.5, False
    add("Lamp", data)
    assert read()[0].lights[0].sphere
    data.use_soft_falloff = True
    assert read()[1] == []
