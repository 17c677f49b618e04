# SPDX-License-Identifier: GPL-3.0-or-later
"""Images are read as Cycles takes them."""

from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from addon.blender.read import images
from addon.blender.read.bundled import bundled
from addon.blender.read.images import read_image
from addon.core.base.notes import Notes
from addon.core.base.steps import completed
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


FORMATS = [
    ("png", "uint8", 1, 0),
    ("png", "uint8", 2, 0),
    ("png", "uint8", 3, 0),
    ("png", "uint8", 4, 0),
    ("tif", "uint16", 3, 0),
    ("tif", "uint8", 3, 16),
    ("exr", "half", 3, 0),
    ("exr", "half", 4, 16),
    ("exr", "float", 6, 16),
]
"""Suffix, type, channels and size of the tiles (0: none)."""


def written(path: Path, kind: str, channels: int, tile: int = 0) -> np.ndarray:
    """Write a file of 37 x 53 texels of random numbers, and return those that are read from it, rows from the top."""
    oiio = bundled("OpenImageIO")
    spec = oiio.ImageSpec(53, 37, channels, kind)
    spec.tile_width = spec.tile_height = tile
    spec.attribute("oiio:UnassociatedAlpha", 1)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec), oiio.geterror()
    assert out.write_image(np.random.default_rng(3).random((37, 53, channels), np.float32))
    out.close()
    wishes = oiio.ImageSpec()
    wishes.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(str(path), wishes)
    found = source.read_image(0, 0, 0, channels, kind)
    source.close()
    return np.asarray(found).reshape(37, 53, channels)


@pytest.mark.parametrize(("suffix", "kind", "channels", "tile"), FORMATS)
def test_files_keep_their_type_and_channels(
    suffix: str, kind: str, channels: int, tile: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("addon.blender.read.images.files.BLOCK", 53 * 4 * 5)  # few rows at once
    path, notes = tmp_path / f"picture.{suffix}", Notes()
    expected = written(path, kind, channels, tile)[::-1, :, :4]
    picture = bpy.data.images.load(str(path))
    picture.colorspace_settings.name, picture.alpha_mode = "Non-Color", "CHANNEL_PACKED"
    found = read_image(picture, notes).pixels
    assert isinstance(found.base, bytes), "shared with the native module"
    assert found.dtype == expected.dtype
    np.testing.assert_array_equal(found, expected)
    picture.alpha_mode = "NONE"
    np.testing.assert_array_equal(
        read_image(picture, notes).pixels, expected[..., [0, 0, 0] if channels == 2 else slice(3)]
    )
    assert not notes


@pytest.mark.parametrize(
    ("suffix", "channels"), [("png", 1), ("png", 2), ("png", 3), ("png", 4), ("jpg", 1), ("jpg", 3)]
)
def test_packed_files_are_read_as_blender_holds_them(
    suffix: str, channels: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / f"picture.{suffix}"
    written(path, "uint8", channels)
    picture = bpy.data.images.load(str(path))
    picture.pack()
    path.unlink()
    for mode in ("STRAIGHT", "NONE"):
        picture.alpha_mode = mode
        quick = read_image(picture, Notes())
        with monkeypatch.context() as patched:
            patched.setattr("addon.blender.read.images.buffers.PLAIN", (("none", "none"),))
            held = read_image(picture, Notes())
        assert quick.pixels.shape[2] == (4 if channels in (2, 4) and mode == "STRAIGHT" else 3)
        assert held.srgb == quick.srgb
        np.testing.assert_array_equal(quick.pixels, held.pixels[..., : quick.pixels.shape[2]])


@pytest.mark.parametrize("floats", [False, True])
@pytest.mark.parametrize(("size", "most", "by"), [((300, 200), 128, 4), ((512, 3), 128, 4), ((128, 128), 128, 1)])
def test_large_images_are_halved_to_the_limit_of_their_size(
    floats: bool, size: tuple[int, int], most: int, by: int
) -> None:
    """The numbers are those of Cycles: means of whole squares, of bytes rounded to bytes."""
    picture = bpy.data.images.new("Large", *size, alpha=True, float_buffer=floats)
    picture.alpha_mode, picture.colorspace_settings.name = "CHANNEL_PACKED", "Non-Color"
    values = np.random.default_rng(5).random((size[1], size[0], 4), np.float32)
    picture.pixels.foreach_set(values.reshape(-1))
    whole = read_image(picture, Notes()).pixels.astype(float)
    found = read_image(picture, Notes(), most=most).pixels
    assert found.dtype == (np.float32 if floats else np.uint8)
    width, height = size[0] // by, max(size[1] // by, 1)
    squares = whole[: height * by, : width * by].reshape(height, -1, width, by, 4).mean(axis=(1, 3))
    assert found.shape == squares.shape
    np.testing.assert_allclose(found, squares, atol=1e-6 if floats else 0.5)


def test_images_that_exceed_the_memory_are_halved_with_a_note(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(tmp_path / "small.png", "uint8", 3)
    made = {"small": bpy.data.images.load(str(tmp_path / "small.png")), "large": bpy.data.images.new("Large", 200, 100)}
    made["large"].pixels[:] = np.full(200 * 100 * 4, 0.5, np.float32)
    whole = 53 * 37 * 3 + 200 * 100 * 4
    for share, sizes, names in (
        (1.1, ((37, 53), (100, 200)), []),
        (0.9, ((37, 53), (50, 100)), ["Large"]),
        (0.2, ((18, 26), (25, 50)), ["small.png, Large"]),
    ):
        free = int(share * whole / images.SHARE)
        monkeypatch.setattr(images.native, "load", lambda free=free: SimpleNamespace(free_memory=lambda: free))
        gallery, notes = images.Gallery(), Notes()
        used = {gallery.number(made[name]) for name in made}
        found = completed(gallery.read(used, notes))
        assert tuple(image.pixels.shape[:2] for image in found) == sizes
        assert [line.split("texels: ")[1] for line in notes.lines()] == names


def test_what_blender_holds_keeps_alpha_only_if_anything_is_transparent() -> None:
    picture = bpy.data.images.new("Painted", 5, 3, alpha=True)
    values = np.random.default_rng(4).random((3, 5, 4), np.float32)
    for alpha, channels in ((values[..., 3], 4), (1.0, 3)):
        values[..., 3] = alpha
        picture.alpha_mode = "CHANNEL_PACKED"
        picture.pixels.foreach_set(values.reshape(-1))
        found = read_image(picture, Notes()).pixels
        np.testing.assert_allclose(found, values[..., :channels] * 255, atol=0.51)
