# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of all sources, formats, colour spaces and projections, compared with Cycles."""

from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import OpenImageIO
import pytest

from addon.blender.read.bundled import bundled
from tests.blender import atlas
from tests.blender.atlas import add, made
from tests.blender.shapes import cube, grid


def written(path: Path, seed: int, kind: str = "uint8", channels: int = 3, *, width: int = 7, height: int = 5) -> Path:
    """A file of random numbers; alpha is never 0."""
    values = np.random.default_rng(seed).uniform(0.05, 1, (height, width, channels))
    spec = OpenImageIO.ImageSpec(width, height, channels, kind)
    if channels in (2, 4):
        spec.alpha_channel = channels - 1
        if path.suffix == ".png":
            spec.attribute("oiio:UnassociatedAlpha", 1)
    out = OpenImageIO.ImageOutput.create(str(path))
    assert out.open(str(path), spec), OpenImageIO.geterror()
    assert out.write_image(values.astype(np.float32))
    out.close()
    return path


def loaded(path: Path, space: str | None = None, **settings: Any) -> Any:
    """A new image of a file."""
    image = bpy.data.images.load(str(path))
    if space is not None:
        image.colorspace_settings.name = space
    for name, value in settings.items():
        setattr(image, name, value)
    return image


def shown(image: Any, scale: float = 1.0, *, alpha: bool = False, **settings: Any) -> atlas.Maker:
    """The image over the tile, `scale` times in each direction."""
    user = settings.pop("user", {})

    def make(tree: Any) -> Any:
        where = made("TexCoord", output="Generated")
        mapping = made("Mapping", where, Scale=(scale,) * 3, Location=(0.03, 0.02, 0.0))
        texture = add(tree, "TexImage", mapping, image=image, **settings)
        for name, value in user.items():
            setattr(texture.image_user, name, value)
        color, share = texture.outputs["Color"], texture.outputs["Alpha"]
        return made("VectorMath", color, share, operation="MULTIPLY")(tree) if alpha else color

    return make


def formats(folder: Path) -> Iterator[tuple[str, atlas.Maker]]:
    """Bytes, 16-bit integers, half and single precision, of one to four channels."""
    for suffix, kind in (("png", "uint8"), ("png", "uint16"), ("tif", "uint16"), ("tif", "float"), ("exr", "half")):
        for channels in (1, 2, 3, 4):
            name = f"{suffix} {kind} {channels}"
            image = loaded(written(folder / f"{kind}{channels}.{suffix}", channels, kind, channels))
            yield name, shown(image)
            if channels in (2, 4):
                yield f"{name} straight", shown(image, alpha=True)
    image = loaded(written(folder / "grey.png", 1, "uint8", 1))
    yield "clipped grey", shown(image, 2.0, alpha=True, extension="CLIP")


SPACES = ("Non-Color", "sRGB", "Linear Rec.709", "Display P3", "ACEScg", "AgX Log", "Filmic Log", "Rec.1886")


def spaces(folder: Path) -> Iterator[tuple[str, atlas.Maker]]:
    """Colour spaces of Blender's configuration."""
    known = bundled("PyOpenColorIO").GetCurrentConfig()
    for space in SPACES:
        if known.getColorSpace(space) is None:
            continue
        for kind, channels in (("uint8", 3), ("uint8", 4), ("uint16", 3), ("uint8", 1)):
            path = written(folder / f"{kind}{channels}.png", channels, kind, channels)
            yield f"{space} {kind} {channels}", shown(loaded(path, space))
        yield f"{space} float", shown(loaded(written(folder / "f.exr", 5, "float", 3), space))


def alphas(folder: Path) -> Iterator[tuple[str, atlas.Maker]]:
    """Effect of alpha on colours, in files and in Blender's memory."""
    for mode in ("STRAIGHT", "PREMUL", "CHANNEL_PACKED", "NONE"):
        for suffix, kind in (("png", "uint8"), ("png", "uint16"), ("tga", "uint8"), ("exr", "half")):
            path = written(folder / f"{kind}.{suffix}", 4, kind, 4)
            for alpha in (False, True):
                yield f"{mode} {suffix} {kind} {alpha}", shown(loaded(path, alpha_mode=mode), alpha=alpha)
        for is_float in (False, True):
            image = bpy.data.images.new(mode, 5, 4, alpha=True, float_buffer=is_float)
            image.alpha_mode = mode
            image.pixels.foreach_set(np.random.default_rng(7).uniform(0.1, 1, 80).astype(np.float32))
            yield f"{mode} made {is_float}", shown(image)
            yield f"{mode} made {is_float} straight", shown(image, alpha=True)


def kept(folder: Path) -> Iterator[tuple[str, atlas.Maker]]:
    """Packed and missing files, and one that is painted."""
    for kind, channels in (("uint8", 3), ("uint8", 4), ("uint16", 3)):
        image = loaded(written(folder / f"{kind}{channels}.png", channels, kind, channels))
        image.pack()
        (folder / f"{kind}{channels}.png").unlink()
        yield f"packed {kind} {channels}", shown(image)
    gone = loaded(written(folder / "gone.png", 3))
    (folder / "gone.png").unlink()
    gone.buffers_free()
    yield "missing", shown(gone)


def interpolations(folder: Path) -> Iterator[tuple[str, atlas.Maker]]:
    """All ways to interpolate and to continue."""
    image = loaded(written(folder / "four.png", 9, "uint8", 4))
    for mode, extension in product(("Linear", "Closest", "Cubic", "Smart"), ("REPEAT", "EXTEND", "CLIP", "MIRROR")):
        yield f"{mode} {extension}", shown(image, 2.7, interpolation=mode, extension=extension)


def sequences(folder: Path) -> Iterator[tuple[str, atlas.Maker]]:
    """Frames of a sequence of files that a scene at frame 12 shows."""
    for frame in range(1, 7):
        written(folder / f"shot.v2_{frame:04d}.png", frame)
    image = loaded(folder / "shot.v2_0001.png", source="SEQUENCE")
    for start, offset, cyclic, live, length in (
        *((1, 0, False, True, 6), (9, 0, False, True, 6), (9, 2, False, True, 3), (9, 0, False, False, 6)),
        *((1, 0, True, True, 5), (1, 1, True, True, 4), (14, 1, False, True, 4), (14, 0, True, True, 4)),
        (8, 3, False, True, 9),
    ):
        user = {"frame_start": start, "frame_offset": offset, "use_cyclic": cyclic, "use_auto_refresh": live}
        name = f"{start} {offset} {cyclic} {live} {length}"
        yield name, shown(image, user={**user, "frame_duration": length})


def squares(folder: Path) -> Iterator[tuple[str, atlas.Maker]]:
    """UDIM tiles, of different sizes, one of them missing."""
    for mark, names in (("<UDIM>", ("1001", "1002", "1012")), ("<UVTILE>", ("u1_v1", "u2_v1", "u2_v2"))):
        for index, name in enumerate(names):
            written(folder / f"wall{name}.png", 20 + index, "uint16" if index else "uint8", 3, width=3 + index)
        image = loaded(folder / f"wall{names[0]}.png", source="TILED")
        image.filepath = str(folder / f"wall{mark}.png")
        for number in (1002, 1012, 1021):
            image.tiles.new(number)
        yield mark, shown(image, 2.4)
        yield f"{mark} closest", shown(image, 2.4, interpolation="Closest", extension="EXTEND")
    packed = loaded(written(folder / "packed.1001.png", 30), source="TILED")
    packed.filepath = str(folder / "packed.<UDIM>.png")
    written(folder / "packed.1002.png", 31, width=4)
    packed.tiles.new(1002)
    packed.pack()
    for path in folder.glob("packed.*"):
        path.unlink()
    yield "packed", shown(packed, 2.4)
    # Before 5.0, Cycles shows tiles in pink that are in no file.
    if bpy.app.version >= (5, 0):
        painted = bpy.data.images.new("Painted", 5, 4, tiled=True)
        painted.pixels.foreach_set(np.random.default_rng(8).uniform(0.1, 1, 80).astype(np.float32))
        yield "painted", shown(painted, 2.4)


def films(folder: Path) -> Iterator[tuple[str, atlas.Maker]]:
    """Frames of a movie that a scene at frame 12 shows."""
    maker = bpy.data.scenes.new("Film")
    strips = maker.sequence_editor_create()
    strips = strips.strips if hasattr(strips, "strips") else strips.sequences
    for frame in range(1, 7):
        end = {"length": 1} if bpy.app.version >= (5, 0) else {"frame_end": frame + 1}
        strip = strips.new_effect(f"{frame}", "COLOR", 1, frame_start=frame, **end)
        strip.color = (0.15 * frame, 0.9 - 0.1 * frame, 0.3)
    render = maker.render
    render.resolution_x = render.resolution_y = 64
    render.resolution_percentage, render.filepath = 100, str(folder / "film.mp4")
    maker.frame_start, maker.frame_end = 1, 6
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = "VIDEO"
    render.image_settings.file_format = "FFMPEG"
    render.ffmpeg.format, render.ffmpeg.codec = "MPEG4", "H264"
    render.ffmpeg.constant_rate_factor = "PERC_LOSSLESS"
    bpy.ops.render.render(scene=maker.name, animation=True)
    bpy.data.scenes.remove(maker)
    film = loaded(folder / "film.mp4", source="MOVIE")
    for start, offset, cyclic, length in ((9, 0, False, 6), (9, 1, False, 6), (11, 0, True, 5), (1, 0, False, 6)):
        user = {"frame_start": start, "frame_offset": offset, "use_cyclic": cyclic, "use_auto_refresh": True}
        yield f"{start} {offset} {cyclic} {length}", shown(film, user={**user, "frame_duration": length})


def projections(folder: Path) -> Iterator[tuple[str, atlas.Maker]]:
    """Projections of images on a turned cube and of panoramas."""
    image = loaded(written(folder / "six.png", 11, width=16, height=12))
    for kind in ("SPHERE", "TUBE", "FLAT"):
        yield kind, shown(image, projection=kind)
    for blend in (0.0, 0.3, 1.0):
        yield f"BOX {blend}", shown(image, projection="BOX", projection_blend=blend)
    for kind, mode in product(("EQUIRECTANGULAR", "MIRROR_BALL"), ("Linear", "Cubic")):
        settings = {"image": image, "projection": kind, "interpolation": mode}
        yield f"{kind} {mode}", made("TexEnvironment", atlas.place, **settings)


@pytest.mark.parametrize(
    "family", [formats, spaces, alphas, kept, interpolations, sequences, squares, films, projections]
)
def test_images_are_those_of_cycles(family: Callable[[Path], Any], scene: Any, tmp_path: Path) -> None:
    makers = dict(family(tmp_path))
    solid = family is projections
    atlas.sheet(scene, makers, cube(size=0.5, smooth=True) if solid else grid(1))
    for index, item in enumerate(atlas.tiles(scene)):
        item.rotation_euler = (0.5, 0.4, 0.3 + 0.1 * index) if solid else (0, 0, 0)
        item.scale = (1.0, 1.0, 1.0) if solid else (0.5, 0.5, 1.0)
    scene.frame_set(12)
    assert not atlas.differences(*atlas.both(scene, makers, samples=64, bounces=0))
