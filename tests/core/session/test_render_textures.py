# SPDX-License-Identifier: GPL-3.0-or-later
"""Textures and programs of materials through the renderer's Python face."""

import math

import halfspace_native as native
import numpy as np
import pytest

from tests.render_scenes import FLOOR, camera, finish, image, scene, settings

CORNERS = np.array([[-9, -9], [9, -9], [9, 9], [-9, 9]], np.float32)
UV = (CORNERS[FLOOR[1]] + 9) / 18
"""The floor's texture coordinates, 0 to 1."""

SHOW = {
    "program": [
        {"op": "attribute", "layer": 0},
        {"op": "image", "args": [0], "image": 0, "interpolation": "closest", "extension": "repeat"},
    ],
    "closures": [{"kind": "emission", "emission": 1}],
}
"""Glows as the image says."""


def shown(pixels, *, material=SHOW, camera_changes=None, **parts):
    """The floor as a camera straight above sees it, (4, 8, 3)."""
    images = [{"name": "image", "pixels": np.asarray(pixels, np.float32)}]
    parts = {"lights": [], "images": images, "layers": [np.ascontiguousarray(UV)]} | parts
    made = scene(materials=[material], **parts)
    seen = camera(window=(-8.9, 8.9, -8.9, 8.9)) | (camera_changes or {})
    job = finish(native.render(made, seen, settings(filter="box", filter_width=0.01, samples=1)))
    return image(job).reshape(4, 8, 4)[..., :3]


def test_an_image_lies_on_the_surface_as_its_coordinates_say():
    pixels = np.random.default_rng(1).random((4, 8, 4)).astype(np.float32)
    np.testing.assert_array_equal(shown(pixels), pixels[..., :3])
    assert "textures" not in " ".join(
        scene(materials=[SHOW], images=[{"name": "", "pixels": pixels}], layers=[UV]).left_out
    )
    assert any("textures" in line for line in scene().left_out)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float16, np.float32])
def test_images_of_fewer_channels_are_those_of_four(dtype):
    most = 1 if np.dtype(dtype).kind == "f" else np.iinfo(dtype).max
    pixels = (np.random.default_rng(2).random((4, 8, 4)) * most).astype(dtype)

    def seen(stored):
        found = scene(materials=[SHOW], images=[{"name": "", "pixels": stored}], layers=[np.ascontiguousarray(UV)])
        view = camera(window=(-8.9, 8.9, -8.9, 8.9))
        job = finish(native.render(found, view, settings(filter="box", filter_width=0.01, samples=1)))
        return image(job)

    opaque, grey = pixels.copy(), pixels[..., [0, 0, 0, 3]]
    opaque[..., 3] = most
    np.testing.assert_array_equal(seen(pixels[..., :3]), seen(opaque))
    np.testing.assert_array_equal(seen(pixels[..., [0, 3]]), seen(grey))
    with pytest.raises(ValueError, match="1 to 4"):
        seen(np.zeros((4, 8, 5), dtype))


def test_bad_images_and_values_give_a_picture():
    assert (shown(np.zeros((0, 0, 4), np.float32)) == [1, 0, 1]).all(), "missing: pink"
    nan = np.full((1, 1, 4), np.nan, np.float32)
    assert (shown(nan) == 0).all()
    assert (shown(np.ones((1, 1, 4), np.float32), layers=[None]) == 1).all(), "no coordinates"
    infinite = {"closures": [{"kind": "emission", "emission": math.inf}]}
    assert (shown(np.ones((1, 1, 4)), material=infinite) == 0).all()
    inside_out = {"closures": [{"kind": "glass", "ior": 0.0, "roughness": math.nan, "weight": 5.0}]}
    assert np.isfinite(shown(np.ones((1, 1, 4)), material=inside_out)).all()


@pytest.mark.parametrize(
    ("material", "message"),
    [
        ({"closures": [{"kind": "fur"}]}, "kind"),
        ({"closures": [{"kind": "diffuse"}] * 9}, "more than 8"),
        ({"closures": [{"kind": "diffuse", "color": 3}]}, "does not exist"),
        ({"closures": [{"kind": "diffuse", "color": 0}], "program": [{"op": "warp"}]}, "warp"),
        ({"closures": [{"kind": "diffuse", "color": 0}], "program": [{"op": "attribute", "layer": 7}]}, "layer 7"),
        ({"closures": [{"kind": "diffuse", "color": 0}], "program": [{"op": "gamma", "args": [1.0]}]}, "2 arguments"),
    ],
)
def test_a_broken_program_is_refused_in_words(material, message):
    with pytest.raises(ValueError, match=message):
        scene(materials=[material])
