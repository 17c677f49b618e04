# SPDX-License-Identifier: GPL-3.0-or-later
"""Cryptomatte compared with that of Cycles, and as Blender's own node reads it."""

import json
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import OpenImageIO
import pytest

from addon.blender.measure import pictures
from addon.blender.render.engine import ENGINE
from addon.core.base import cryptomatte
from tests.blender import atlas
from tests.blender.exr_files import both, exr
from tests.blender.shapes import cube, grid, look, material, place

KINDS = ("CryptoObject", "CryptoMaterial", "CryptoAsset")
WIDTH, HEIGHT = 60, 40


@pytest.fixture
def desk(scene: Any) -> Any:
    """Cubes, one of them half transparent, one a child, on a floor without a material."""
    atlas.with_cycles(scene)
    parent = None
    for number, (name, alpha) in enumerate((("Böx", 1.0), ("Glass", 0.4), ("Child", 1.0))):
        paint = material(f"Paint {number // 2}" if alpha == 1 else "Veil", Alpha=alpha)
        item = place(
            name, cube(name), paint, location=(2.2 * number - 2.2, 0.7 * number, 0), rotation_euler=(0.2, 0.1, 0.3)
        )
        if name == "Child":
            item.parent = parent
        parent = item
    place("Floor", grid(1), location=(0, 0, -1.3), scale=(3, 3, 1))
    look((WIDTH, HEIGHT), (0, -9, 5), 1.1)
    atlas.configure(scene, 256, 1)
    layer = bpy.context.view_layer
    layer.use_pass_cryptomatte_object = layer.use_pass_cryptomatte_material = layer.use_pass_cryptomatte_asset = True
    layer.pass_cryptomatte_depth = 6
    return scene


def metadata(path: Path) -> dict[str, str]:
    """The metadata of a file about mattes."""
    file = OpenImageIO.ImageInput.open(str(path))
    found = {one.name: str(one.value) for one in file.spec().extra_attribs if one.name.startswith("cryptomatte/")}
    file.close()
    return found


def coverage(channels: dict[str, Any], kind: str, name: str) -> Any:
    """The share of each pixel that something covers: the sum of its ranks."""
    wanted = np.uint32(cryptomatte.identity(name))
    total = np.zeros((HEIGHT, WIDTH))
    for level in range(3):
        for identity, share in ("rg", "ba"):
            ids = channels[f"{kind}{level:02}.{identity}"].astype(np.float32).view(np.uint32)
            total += np.where(ids == wanted, channels[f"{kind}{level:02}.{share}"], 0.0)
    return total


def test_mattes_and_their_metadata_are_those_of_cycles(desk: Any, tmp_path: Path) -> None:
    ours, theirs = both(desk, tmp_path)
    own, expected = (metadata(tmp_path / f"{engine}.exr") for engine in (ENGINE, "CYCLES"))
    manifests = {key: json.loads(value) for key, value in own.items() if key.endswith("/manifest")}
    assert len(manifests) == 3
    for key, value in expected.items():
        if key in manifests:
            # Cycles lists all materials of the file, also those that no object has.
            assert manifests[key].items() <= json.loads(value).items()
        else:
            assert own[key] == value
    assert set(own) == set(expected)
    names = {
        "CryptoObject": {"Böx", "Glass", "Child", "Floor"},
        "CryptoMaterial": {"Paint 0", "Paint 1", "Veil", "default_surface"},
        "CryptoAsset": {"Böx", "Glass", "Floor"},
    }
    for kind in KINDS:
        key = next(key for key, value in own.items() if value == f"ViewLayer.{kind}").removesuffix("/name")
        for name in names[kind]:
            assert manifests[f"{key}/manifest"][name] == f"{cryptomatte.identity(name):08x}"
            mine, other = coverage(ours, kind, name), coverage(theirs, kind, name)
            assert other.max() > 0.5, (kind, name)
            assert np.abs(mine - other).mean() < 0.01, (kind, name)
            assert abs(mine.mean() - other.mean()) < 0.01 * other.mean(), (kind, name)
        # Ranks descend, and together they cover no more than the pixel.
        shares = np.stack([ours[f"{kind}{level:02}.{c}"] for level in range(3) for c in "ga"])
        assert (np.diff(shares, axis=0) <= 0).all()
        assert shares.sum(axis=0).max() <= 1.0 + 1e-6
    assert f"{KINDS[0]}03.r" not in ours, "six levels are three passes"


def compositor(scene: Any) -> tuple[Any, Any]:
    """The scene's compositing nodes, and the input whose colour becomes the picture."""
    if hasattr(scene, "compositing_node_group"):
        tree = bpy.data.node_groups.new("Mattes", "CompositorNodeTree")
        scene.compositing_node_group = tree
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        return tree, tree.nodes.new("NodeGroupOutput").inputs[0]
    scene.use_nodes = True
    scene.node_tree.nodes.clear()
    return scene.node_tree, scene.node_tree.nodes.new("CompositorNodeComposite").inputs[0]


@pytest.mark.parametrize("name", ["Böx", "Glass"])
def test_blenders_node_shows_the_matte_of_an_object(desk: Any, tmp_path: Path, name: str) -> None:
    desk.render.engine = ENGINE
    expected = coverage(exr(desk, tmp_path / "picture.exr"), "CryptoObject", name)
    tree, out = compositor(desk)
    picker = tree.nodes.new("CompositorNodeCryptomatteV2")
    picker.source, picker.scene, picker.layer_name = "RENDER", desk, "ViewLayer.CryptoObject"
    picker.matte_id = name
    tree.links.new(picker.outputs["Matte"], out)
    matte = pictures.render(desk)[..., 0]
    assert expected.max() > 0.5
    assert np.allclose(matte, expected, atol=1e-3)
