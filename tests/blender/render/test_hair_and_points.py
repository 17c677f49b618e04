# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair and point clouds compared with Cycles."""

from typing import Any

import numpy as np
import pytest
from mathutils import Matrix

from addon.blender.read.strands import collecting
from addon.blender.render.engine import ENGINE
from addon.core.scene import tubes
from tests.blender import atlas
from tests.blender.atlas import made
from tests.blender.rounds import camera, cloud, fur, hair, locks
from tests.blender.shapes import grid, lamp, place, world

SAMPLES = 100

SHADERS = {
    "colour": {"Color": (0.6, 0.3, 0.1, 1)},
    "melanin": {"parametrization": "MELANIN", "Melanin": 0.4, "Melanin_Redness": 0.7, "Tint": (0.9, 0.8, 0.7, 1)},
    "absorption": {"parametrization": "ABSORPTION", "Absorption_Coefficient": (0.1, 0.3, 0.8)},
    "rough": {"Color": (0.7, 0.5, 0.3, 1), "Roughness": 0.7, "Radial_Roughness": 0.8, "Offset": 0.1},
    "coat": {"Color": (0.7, 0.5, 0.3, 1), "Coat": 0.7, "IOR": 1.3, "Roughness": 0.5},
    "random": {"parametrization": "MELANIN", "Melanin": 0.3, "Random_Color": 0.8, "Random_Roughness": 0.5},
    "reflection": {"component": "Reflection", "Color": (0.6, 0.5, 0.4, 1), "RoughnessU": 0.3, "RoughnessV": 0.4},
    "transmission": {"component": "Transmission", "Color": (0.6, 0.5, 0.4, 1), "RoughnessU": 0.4, "RoughnessV": 0.4},
}
"""Settings of the shaders of hair, with fitting light."""


@pytest.fixture(autouse=True)
def view(scene: Any) -> None:
    atlas.with_cycles(scene)
    camera(scene, width=64)


def painted(kind: str = "BsdfDiffuse", color: Any = (0.7, 0.5, 0.3, 1)) -> Any:
    """A material of one shader."""
    return atlas.tile_material("Painted", made(kind, Color=color))


def hairy(settings: dict[str, Any]) -> atlas.Maker:
    """A shader of hair."""
    return made("BsdfHair" if "component" in settings else "BsdfHairPrincipled", **settings)


def strands(radius: float) -> Any:
    """Hairs next to each other, which rise a little."""
    across = np.linspace(-0.35, 0.35, 6)[:, None]
    begin = np.stack([across, np.full_like(across, -0.5), np.zeros_like(across)], axis=2)
    return hair(begin + np.linspace(0, 1, 5)[None, :, None] * (0.0, 1.0, 0.3), radius)


def light(sun: float) -> None:
    """Light the scene by a grey world, or by a sun."""
    world(*[0.0 if sun else 0.5] * 3)
    if sun:
        lamp("SUN", sun, rotation_euler=(0.9, 0.4, 0))


def compared(scene: Any, shape: str = "THICK") -> Any:
    """The pictures of this engine and of Cycles."""
    atlas.configure(scene, SAMPLES, 2)
    scene.cycles_curves.shape = shape
    return atlas.pair(scene)


def assert_alike(ours: Any, theirs: Any, background: float, share: float = 0.01, alike: float = 0.9) -> None:
    """The means of what is not background, and the pixels, agree."""
    mean, expected = (picture.mean(axis=(0, 1)) for picture in (ours, theirs))
    assert np.abs(expected - background).max() > 0.01, "the objects are seen"
    assert np.abs(mean - expected).max() <= share * np.abs(expected).max(), (mean, expected)
    assert np.corrcoef(ours.ravel(), theirs.ravel())[0, 1] > alike


@pytest.mark.parametrize("shape", ["THICK", "RIBBONS"])
@pytest.mark.parametrize(("count", "radius"), [(200, 0.01), (60, 0.05)])
def test_coverage_of_hair(scene: Any, shape: str, count: int, radius: float) -> None:
    curves = hair(locks(count), [radius, radius, radius, radius / 2, 0])
    place("Curls", curves, painted("Emission"))
    light(0)
    assert_alike(*compared(scene, shape), 0.5)


@pytest.mark.parametrize("sun", [0.0, 3.0])
def test_brightness_of_hair(scene: Any, sun: float) -> None:
    # Cycles leaves out the shadow of a hair on itself: straight hairs have none.
    curves = hair(locks(150, bend=0.0), [0.012, 0.012, 0.012, 0.006, 0])
    place("Curls", curves, painted())
    light(sun)
    assert_alike(*compared(scene), 0.0 if sun else 0.5, share=0.01)


@pytest.mark.parametrize("sun", [0.0, 3.0])
@pytest.mark.parametrize("merged", [True, False])
def test_brightness_of_points(scene: Any, sun: float, merged: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if not merged:
        monkeypatch.setattr(collecting, "MERGED", 0)
    rng = np.random.default_rng(3)
    dust = cloud(rng.uniform(-2.5, 2.5, (60, 3)) * (1, 1, 0.3), rng.uniform(0.02, 0.3, 60))
    place("Dust", dust, painted())
    light(sun)
    assert_alike(*compared(scene), 0.0 if sun else 0.5, alike=0.98)


@pytest.mark.parametrize("layout", ["merged", "flatten", "two-level"])
def test_values_of_points_are_those_of_cycles(scene: Any, layout: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if layout != "merged":
        monkeypatch.setattr(collecting, "MERGED", 0)
        scene.halfspace.instancing = layout
    rng = np.random.default_rng(3)
    dust = cloud(rng.uniform(-2.5, 2.5, (60, 3)) * (1, 1, 0.3), rng.uniform(0.02, 0.3, 60))
    shade = dust.attributes.new("shade", "FLOAT_COLOR", "POINT")
    shade.data.foreach_set("color", rng.uniform(0, 1, 60 * 4).astype(np.float32))
    # Add what differs between points, within them, and between objects.
    total = made("Attribute", output="Color", attribute_name="shade")
    own = ("PointInfo", "Random"), ("PointInfo", "Radius"), ("TexCoord", "Object"), ("ObjectInfo", "Random")
    for kind, name in own:
        total = made("VectorMath", total, atlas.read(kind, name, 0.2, 0.2))
    painter = painted("Emission", total)
    place("Dust", dust, painter, rotation_euler=(0.2, 0.4, 0.3))
    place("Grid", grid(2), painter, location=(0, 0, -0.9))
    light(0)
    ours, theirs = compared(scene)
    assert_alike(ours, theirs, 0.5, alike=0.98)


def test_particle_hair_with_children(scene: Any) -> None:
    item = place("Head", grid(2), painted("Emission"), rotation_euler=(1.1, 0.2, 0))
    fur(item, 30, hair_length=1.5, child_type="SIMPLE", rendered_child_count=4, radius_scale=0.05, tip_radius=0.2)
    item.show_instancer_for_render = False
    light(0)
    assert_alike(*compared(scene), 0.5)
    assert "Head: 120 hairs as" in atlas.report(scene).made[0]


def test_tangent_normals_of_hair_are_those_of_cycles(scene: Any) -> None:
    curves = hair(locks(12), [0.2, 0.15, 0.1, 0.1, 0.05])
    place("Curls", curves, painted("Emission", atlas.read("HairInfo", "Tangent Normal"))).rotation_euler = (
        0.2,
        0.4,
        0.3,
    )
    light(0)
    atlas.remember_nodes()
    ours, theirs = compared(scene)
    assert_alike(ours, theirs, 0.5, alike=0.95)
    assert not atlas.differences({"all": ours}, {"all": theirs})


def test_values_of_hair_are_those_of_cycles(scene: Any) -> None:
    total = None
    factors = {"Is Strand": 0.1, "Intercept": 0.5, "Length": 0.2, "Thickness": 5.0, "Random": 0.3}
    for name, factor in factors.items():
        value = made("HairInfo", output=name)
        total = made("Math", value, factor, 0.0 if total is None else total, operation="MULTIPLY_ADD")
    curves = hair(locks(12), [0.2, 0.15, 0.1, 0.1, 0.05])
    place("Curls", curves, painted("Emission", total))
    light(0)
    assert_alike(*compared(scene), 0.5, alike=0.99)


@pytest.mark.parametrize("sun", [0.0, 3.0])
def test_shaders_of_hair_are_those_of_cycles(scene: Any, sun: float, monkeypatch: pytest.MonkeyPatch) -> None:
    # Few hairs of few sides have another breadth than round ones. Thin hair keeps the open ends of the tubes apart from
    # their neighbours in the sheet. Hair that only transmits is dark in the sun.
    monkeypatch.setattr(tubes, "FEWEST_SIDES", tubes.MOST_SIDES)
    makers = {name: hairy(settings) for name, settings in SHADERS.items() if not (sun and name == "transmission")}
    atlas.sheet(scene, makers, strands(0.02 if sun else 0.05))
    light(sun)
    scene.cycles_curves.shape = "THICK"
    ours, theirs = atlas.both(scene, makers, samples=128, bounces=0 if sun else 1)
    assert not atlas.differences(ours, theirs, alike=None if sun else 0.9)


def test_hair_that_overlaps_lies_between_both_models_of_cycles(scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    # Cycles sees the inside of another hair that a ray begins in, with ribbons never; here the inside is not seen.
    monkeypatch.setattr(tubes, "FEWEST_SIDES", tubes.MOST_SIDES)
    makers = {name: hairy(settings) for name, settings in SHADERS.items() if "component" not in settings}
    atlas.sheet(scene, makers, strands(0.1))
    light(0.0)
    atlas.configure(scene, 32, 8)
    ours = atlas.rendered(scene, makers, ENGINE)
    of_cycles = []
    for shape in ("THICK", "RIBBONS"):
        scene.cycles_curves.shape = shape
        of_cycles.append(atlas.rendered(scene, makers, "CYCLES"))
    for name, tile in ours.items():
        thick, found, ribbons = (one.mean(axis=(0, 1)) for one in (of_cycles[0][name], tile, of_cycles[1][name]))
        assert (thick < found).all(), (name, thick, found)
        assert (found < 1.01 * ribbons).all(), (name, found, ribbons)


def test_shaders_of_hair_on_a_mesh_are_those_of_cycles(scene: Any) -> None:
    # In the sun, Cycles leaves some of these triangles black.
    makers = {name: hairy(settings) for name, settings in SHADERS.items()}
    mesh = grid(2)
    mesh.transform(Matrix.Diagonal((0.4, 0.4, 0.4, 1.0)))
    atlas.sheet(scene, makers, mesh)
    light(0.0)
    ours, theirs = atlas.both(scene, makers, samples=64, bounces=1)
    assert not atlas.differences(ours, theirs)
