# SPDX-License-Identifier: GPL-3.0-or-later
"""Picture files: what is read is what was written, and a file is whole or not there, whatever a full disk did."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from addon.core.base import picture_files
from addon.core.base.picture_files import Picture

NAMES = ["a.png", "a.jpg", "a.exr"]


@pytest.fixture
def wholes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The bytes of a small picture by the names of files."""
    folder = tmp_path_factory.mktemp("whole")
    pixels = np.random.default_rng(1).uniform(0, 1, (6, 4, 3)).astype(np.float32)
    for name in NAMES:
        picture_files.write(folder / name, Picture(pixels, ("R", "G", "B")))
    return {name: (folder / name).read_bytes() for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_a_whole_picture_takes_its_name(name: str, wholes: dict[str, bytes], tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(b"old")
    with picture_files.replacing(path) as fresh:
        assert fresh.suffix == path.suffix
        fresh.write_bytes(wholes[name])
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == wholes[name]
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", NAMES)
def test_a_part_of_a_picture_leaves_the_old_one(name: str, wholes: dict[str, bytes], tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(b"old")
    for length in range(len(wholes[name])):
        with pytest.raises(OSError, match="incomplete") as told, picture_files.replacing(path) as fresh:
            fresh.write_bytes(wholes[name][:length])
        assert str(told.value).startswith(f"{path}: cannot be written: ")
        assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", NAMES)
def test_a_broken_file_is_one_line_with_its_name(
    name: str, wholes: dict[str, bytes], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    for content in (b"", b"no picture", wholes[name][: len(wholes[name]) // 2]):
        path.write_bytes(content)
        with pytest.raises(OSError, match="cannot be read: ") as told:
            picture_files.read(path)
        assert str(told.value).startswith(f"{path}: ")
        assert str(told.value).count("\n") == 0
    assert capfd.readouterr().err == "", "libpng prints nothing"
    with pytest.raises(OSError, match="there is no such file"):
        picture_files.read(tmp_path / "none.png")


def test_a_missing_picture_is_an_error_with_its_name(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    with pytest.raises(OSError, match="nothing was written") as told, picture_files.replacing(path):
        pass
    assert str(told.value).startswith(f"{path}: ")
    nowhere = tmp_path / "nowhere" / "a.png"
    with pytest.raises(OSError, match="cannot be written: No such file") as told, picture_files.replacing(nowhere):
        pass
    assert str(told.value).startswith(f"{nowhere}: ")


@pytest.mark.parametrize("compression", picture_files.COMPRESSIONS)
def test_channels_of_a_file_are_equal_bit_for_bit(compression: str, tmp_path: Path) -> None:
    bits = np.random.default_rng(1).integers(0, 2**32, (64, 33, 5), dtype=np.uint32)
    pixels = bits.view(np.float32)
    names = ("ViewLayer.Combined.R", "ViewLayer.Combined.G", "ViewLayer.Combined.B", "ViewLayer.Depth.Z", "Steps")
    path = tmp_path / "a.exr"
    picture = Picture(pixels, names, attributes={"structure": "kd:nodes=boxes", "samples": 16, "seconds": 1.5})
    picture_files.write(path, picture, compression)
    found = picture_files.read(path)
    order = [found.names.index(name) for name in names]
    if compression not in ("pxr24", "dwaa", "dwab"):  # the others lose nothing of single precision
        assert found.pixels[..., order].tobytes() == pixels.tobytes()
    assert found.attributes["halfspace:structure"] == "kd:nodes=boxes"
    assert found.attributes["halfspace:samples"] == 16
    assert found.attributes["compression"] == compression
    # Written again with other attributes, the channels keep their values.
    picture_files.describe(path, {"samples": 17}, "zip")
    again = picture_files.read(path)
    assert again.pixels.tobytes() == found.pixels.tobytes()
    assert again.attributes["halfspace:samples"] == 17
    assert again.attributes["halfspace:structure"] == "kd:nodes=boxes"


def test_a_picture_in_memory_is_as_a_display_shows_it(tmp_path: Path) -> None:
    picture = np.zeros((3, 5, 3), np.float32)
    picture[0, 0] = 1.0, 0.5, 0.0
    picture[2, 4] = 7.0, np.nan, -1.0
    path = tmp_path / "a.png"
    path.write_bytes(picture_files.encoded(picture))
    found = np.rint(255 * picture_files.read(path).pixels)
    # sRGB of one half is 188.
    assert found[0, 0].tolist() == [255, 188, 0]
    assert found[2, 4].tolist() == [255, 0, 0]
    assert int(found.sum()) == 255 + 188 + 255
    shown = np.linspace(0, 1, 1001, dtype=np.float32)
    assert np.abs(picture_files.displayed(picture_files.linear(shown)) - shown).max() < 1e-6


def test_light_of_a_transparent_picture_is_multiplied_after_it_was_made_linear(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    oiio = picture_files.module()
    out = oiio.ImageOutput.create(str(path))
    spec = oiio.ImageSpec(1, 1, 4, "uint8")
    spec.attribute("oiio:UnassociatedAlpha", 1)
    assert out.open(str(path), spec)
    assert out.write_image(np.array([[[188, 255, 0, 128]]], np.uint8))
    assert out.close()
    found = picture_files.read(path)
    assert found.is_displayed
    assert (255 * found.pixels[0, 0]).round().tolist() == [188, 255, 0, 128]
    assert found.light()[0, 0] == pytest.approx([0.5 * 128 / 255, 128 / 255, 0], abs=0.003)
    # Floats are light, whatever the file.
    saved = tmp_path / "a.exr"
    picture_files.write(saved, Picture(np.full((1, 1, 3), 0.5, np.float32), ("R", "G", "B")))
    assert picture_files.read(saved).light().tolist() == [[[0.5, 0.5, 0.5]]]


def test_the_colour_of_a_file_is_that_of_its_combined_pass() -> None:
    pixels = np.arange(8, dtype=np.float32).reshape(1, 1, 8)
    names = (*(f"L.Normal.{one}" for one in "RGB"), *(f"L.Combined.{one}" for one in "ABGR"), "Z")
    assert Picture(pixels, names).colour().tolist() == [[[6.0, 5.0, 4.0]]]
    assert Picture(pixels[..., :1], ("Y",)).colour().tolist() == [[[0.0, 0.0, 0.0]]]
    with pytest.raises(ValueError, match="no colour among the channels Z"):
        Picture(pixels[..., :1], ("Z",)).colour()
