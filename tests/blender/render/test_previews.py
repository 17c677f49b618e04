# SPDX-License-Identifier: GPL-3.0-or-later
"""Previews of materials, as icons show them."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from shapes import cube, material

from addon.blender.render.engine import ENGINE
from addon.blender.session import reports, trees


def preview(block: Any) -> Any:
    """The pixels of a data block's preview, (h, w, 4)."""
    block.use_fake_user = True
    assert bpy.ops.wm.previews_ensure() == {"FINISHED"}
    found = block.preview
    width, height = found.image_size
    return np.array(found.image_pixels_float, np.float32).reshape(height, width, 4)


def test_materials_have_previews_in_their_colours(scene: Any, add: Any) -> None:
    scene.render.engine = ENGINE
    add("Box", cube())
    bpy.ops.halfspace.build_structure()
    tree, report = trees.last(scene), reports.last(scene)
    pictures = {}
    for name, color in (("Red", (0.8, 0.02, 0.02, 1)), ("Blue", (0.02, 0.02, 0.8, 1))):
        pictures[name] = preview(material(name, Base_Color=color, Roughness=0.8))
    red, blue = (picture[48:80, 48:80, :3].mean(axis=(0, 1)) for picture in pictures.values())
    assert pictures["Red"].shape == (128, 128, 4)
    assert red[0] > 1.3 * red[2]
    assert blue[2] > 1.3 * blue[0]
    assert np.isfinite(pictures["Red"]).all()
    # The structure and the report of the last picture are still those of the scene.
    assert trees.last(scene) is tree
    assert reports.last(scene) is report
