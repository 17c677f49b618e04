# SPDX-License-Identifier: GPL-3.0-or-later
"""Images are read as Cycles takes them."""

import bpy
import numpy as np
import pytest

from addon.blender.read.images import read_image
from addon.core.base.notes import Notes
from addon.core.scene.scene import Image


def numbers(image: Image) -> np.ndarray:
    """The first texel, 0 to 1."""
    first = image.pixels[0, 0]
    return first / (np.iinfo(first.dtype).max if first.dtype.kind == "u" else 1.0)


@pytest.mark.parametrize(
    ("space", "mode", "colour", "expected"),
    [
        ("sRGB", "STRAIGHT", (0.5, 0.5, 0.25), (0.1044, 0.1072, 0.0365)),
        ("sRGB", "PREMUL", (0.25, 0.25, 0.125), (0.1036, 0.1063, 0.0362)),
        ("sRGB", "CHANNEL_PACKED", (0.5, 0.5, 0.25), (0.208, 0.2136, 0.0727)),
        ("Linear Rec.709", "STRAIGHT", (0.25, 0.25, 0.125), (0.123, 0.125, 0.071)),
        ("ACEScg", "STRAIGHT", (0.5, 0.5, 0.25), (0.251, 0.251, 0.1255)),
        ("Non-Color", "STRAIGHT", (0.5, 0.5, 0.25), (0.502, 0.502, 0.251)),
    ],
)
def test_images_are_read_into_the_space_that_the_file_renders_in(
    space: str, mode: str, colour: tuple[float, ...], expected: tuple[float, ...]
) -> None:
    """The numbers are those of Cycles. Alpha is one half."""
    if not hasattr(bpy.data, "colorspace"):
        pytest.skip("files render in a space of their own since Blender 5.0")
    assert bpy.data.colorspace.working_space == "Linear Rec.709"
    found, notes = {}, Notes()
    for working in ("Linear Rec.709", "ACEScg"):
        bpy.ops.wm.set_working_color_space(working_space=working)
        picture = bpy.data.images.new("Tan", 2, 2, alpha=True)
        picture.colorspace_settings.name, picture.alpha_mode = space, mode
        picture.pixels.foreach_set([*colour, 0.5] * 4)  # last: another space generates it anew
        found[working] = read_image(picture, notes)
        bpy.data.images.remove(picture)  # else Blender refuses to change the space
    share = 0.5 if mode == "STRAIGHT" and space != "Non-Color" else 1.0
    assert found["Linear Rec.709"].srgb == (space == "sRGB")
    plain = (0.2614, 0.2523, 0.1063) if space == "ACEScg" else tuple(share * c for c in colour)
    assert numbers(found["Linear Rec.709"]) == pytest.approx((*plain, 0.5), abs=3e-3)
    assert not found["ACEScg"].srgb
    assert numbers(found["ACEScg"]) == pytest.approx((*expected, 0.5), abs=3e-3)
    assert not notes
