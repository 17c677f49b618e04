# SPDX-License-Identifier: GPL-3.0-or-later
"""Picture files outside of Blender's own operators: read, written, checked and replaced through OpenImageIO.

Arrays have their rows from the bottom, as Blender has them; files from the top.
"""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .arrays import F32

COMPRESSIONS = ("zip", "zips", "piz", "rle", "pxr24", "b44", "b44a", "dwaa", "dwab", "none")
"""Of OpenEXR."""

JPEG_QUALITY = 88
"""Percent, as in Blender."""

PREFIX = "halfspace:"
"""Prefix of the names of our attributes in files."""


@dataclass(frozen=True)
class Picture:
    """Channels of a file. pixels: (height, width, channels) float32, rows from the bottom. names: of the channels."""

    pixels: F32
    names: tuple[str, ...]
    is_displayed: bool = False
    """Whether these are integers for a display: sRGB, and not multiplied by alpha."""
    attributes: Mapping[str, Any] = field(default_factory=dict)

    def colour(self) -> F32:
        """The (height, width, 3) colour: R, G and B, those of a Combined pass before others. Raises ValueError."""
        for wanted in ("R", "G", "B"), ("Y", "Y", "Y"):
            found = [place for one in wanted if (place := _channel(self.names, one)) is not None]
            if len(found) == len(wanted):
                return np.ascontiguousarray(self.pixels[..., found])
        raise ValueError(f"no colour among the channels {', '.join(self.names[:8])}")

    def light(self) -> F32:
        """The (height, width, 3) colour as linear light before black. Raises ValueError."""
        if not self.is_displayed:
            return self.colour()
        alpha = _channel(self.names, "A")
        return linear(self.colour()) * (self.pixels[..., alpha, None] if alpha is not None else np.float32(1.0))


def _channel(names: Sequence[str], last: str) -> int | None:
    """Index of the channel with this last part of its name."""
    places = [place for place, name in enumerate(names) if name.rpartition(".")[2] == last]
    combined = [place for place in places if names[place].endswith(f"Combined.{last}")]
    plain = [place for place in places if names[place] == last]
    return next(iter([*plain, *combined, *places]), None)


def module() -> Any:
    """OpenImageIO: as installed, or that of Blender, which has it since 4.4. Raises ImportError, in one sentence."""
    with contextlib.suppress(ImportError):
        import OpenImageIO

        return OpenImageIO
    # With Blender as a module, the modules that it comes with are hidden at first.
    expose = getattr(getattr(sys.modules.get("bpy"), "utils", None), "expose_bundled_modules", None)
    if expose is not None:
        expose()
    try:
        import OpenImageIO
    except ImportError as error:
        raise ImportError("OpenImageIO, which reads and writes pictures, is not installed in this Python") from error
    return OpenImageIO


def read(path: Path) -> Picture:
    """All channels of a file, as stored: of an OpenEXR file those of all parts of equal size.

    Raises OSError with the file's name and the reason.
    """
    oiio = module()
    if not path.is_file():
        raise OSError(f"{path}: there is no such file")
    if _is_cut(path):
        raise OSError(f"{path}: cannot be read: it is incomplete")
    wishes = oiio.ImageSpec()
    wishes.attribute("oiio:UnassociatedAlpha", 1)
    source = _opened(path, wishes)
    is_displayed = str(source.spec().format).startswith("uint")
    parts: list[F32] = []
    names: list[str] = []
    attributes: dict[str, Any] = {}
    try:
        while source.seek_subimage(len(parts), 0):
            spec = source.spec()
            pixels = source.read_image(len(parts), 0, 0, spec.nchannels, "float")
            if (reason := source.geterror()) or pixels is None:
                raise OSError(f"{path}: cannot be read: {_first(reason)}")
            if parts and (spec.height, spec.width) != parts[0].shape[:2]:
                break
            parts.append(pixels.reshape(spec.height, spec.width, spec.nchannels)[::-1])
            names += spec.channelnames
            attributes = {one.name: one.value for one in spec.extra_attribs} | attributes
    finally:
        source.close()
    return Picture(np.concatenate(parts, axis=2, dtype=np.float32), tuple(names), is_displayed, attributes)


def _opened(path: Path, *wishes: Any) -> Any:
    """A file that is read. Raises OSError with the file's name and the reason."""
    oiio = module()
    source = oiio.ImageInput.open(str(path), *wishes)
    if source is None:
        raise OSError(f"{path}: cannot be read: {_first(oiio.geterror())}")
    return source


def size(path: Path) -> tuple[int, int]:
    """Width and height of the pixels in a file. Raises OSError with the file's name and the reason."""
    source = _opened(path)
    spec = source.spec()
    source.close()
    return spec.width, spec.height


def write(path: Path, picture: Picture, compression: str = "zip") -> None:
    """Write a file by its suffix: OpenEXR with float32 channels, PNG or JPEG with the channels as a display shows
    them (sRGB, 8 bits: above 1 white, not finite black), without attributes.

    Raises OSError, which names the file, and then leaves an older picture unchanged.
    """
    with replacing(path) as fresh:
        _write(fresh, path, picture, compression)


def _write(fresh: Path, path: Path, picture: Picture, compression: str) -> None:
    oiio = module()
    pixels = picture.pixels[::-1]
    is_linear = path.suffix.lower() == ".exr"
    if not is_linear:
        pixels = displayed(pixels)
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, "float" if is_linear else "uint8")
    spec.channelnames = picture.names
    spec.attribute("compression", compression if is_linear else f"jpeg:{JPEG_QUALITY}")
    spec.attribute("oiio:ColorSpace", "lin_rec709" if is_linear else "sRGB")
    for name, value in picture.attributes.items() if is_linear else ():
        spec.attribute(PREFIX + name, value)
    out = oiio.ImageOutput.create(str(fresh))
    if out is None:
        raise OSError(f"{path}: cannot be written: {_first(oiio.geterror())}")
    written = out.open(str(fresh), spec) and out.write_image(np.ascontiguousarray(pixels))
    closed = out.close()
    if not (written and closed):
        raise OSError(f"{path}: cannot be written: {_first(out.geterror())}")


def describe(path: Path, attributes: Mapping[str, Any], compression: str) -> None:
    """Write an OpenEXR file again with these attributes and this compression; its channels keep type and value.

    Raises OSError, which names the file.
    """
    oiio, source = module(), _opened(path)
    # Half precision is exact in single, and back.
    parts: list[tuple[Any, Any]] = []
    try:
        while source.seek_subimage(len(parts), 0):
            spec = oiio.ImageSpec(source.spec())
            parts.append((spec, source.read_image(len(parts), 0, 0, spec.nchannels, "float")))
    finally:
        source.close()
    for spec, pixels in parts:
        if pixels is None:
            raise OSError(f"{path}: cannot be read: incomplete, as on a full disk")
        spec.attribute("compression", compression)
        for name, value in attributes.items():
            spec.attribute(PREFIX + name, value)
    with replacing(path) as fresh:
        out = oiio.ImageOutput.create(str(fresh))
        written = out.open(str(fresh), tuple(spec for spec, _ in parts))
        for place, (spec, pixels) in enumerate(parts):
            written = written and (place == 0 or out.open(str(fresh), spec, "AppendSubimage"))
            written = written and out.write_image(pixels)
        if not (out.close() and written):
            raise OSError(f"{path}: cannot be written: {_first(out.geterror())}")


def encoded(picture: F32) -> bytes:
    """A PNG in memory of an (h, w, 3) linear RGB picture, as `write` writes it. Raises OSError and ImportError."""
    with tempfile.TemporaryDirectory(prefix="halfspace-picture-") as folder:
        path = Path(folder) / "picture.png"
        write(path, Picture(picture, ("R", "G", "B")))
        return path.read_bytes()


def displayed(linear: F32) -> F32:
    """Linear values as a display shows them: sRGB, 0 to 1. Values that are not finite are black."""
    shown = np.nan_to_num(linear.astype(np.float64), nan=0.0, posinf=0.0, neginf=0.0).clip(0.0, 1.0)
    curve = 1.055 * np.maximum(shown, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(shown <= 0.0031308, 12.92 * shown, curve).astype(np.float32)


def linear(shown: F32) -> F32:
    """The inverse of `displayed` between 0 and 1."""
    curve = (np.maximum(shown, 0.04045) + 0.055) / 1.055
    return np.where(shown <= 0.04045, shown / 12.92, curve**2.4).astype(np.float32)


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path for a picture in the folder of `path`, with its suffix; renamed to `path` only if it can be
    read whole, because Blender reports no error when the disk fills up while it writes one.

    An older picture stays until then. Raises OSError, which names the file; exceptions of the body pass through.
    Without OpenImageIO only an empty file and a PNG that ends too early are refused.
    """
    target = Path(os.path.realpath(path))  # replace a link's target, not the link
    try:
        folder = tempfile.TemporaryDirectory(dir=target.parent, prefix=".picture-")
    except OSError as error:
        raise _unwritten(path, error.strerror or error) from error
    with folder as name:
        fresh = Path(name) / f"picture{path.suffix}"
        yield fresh
        try:
            if not is_whole(fresh):
                raise _unwritten(path, "the picture is incomplete, as on a full disk")
            with fresh.open("rb+") as file:  # Windows flushes only files open for writing
                os.fsync(file.fileno())
            fresh.replace(target)
        except FileNotFoundError as error:
            raise _unwritten(path, "nothing was written") from error
        except OSError as error:
            if error.errno is None:
                raise
            raise _unwritten(path, error.strerror or error) from error


def is_whole(path: Path) -> bool:
    """Whether all pixels of a file can be read. Raises FileNotFoundError."""
    if path.stat().st_size == 0 or _is_cut(path):
        return False
    try:
        oiio = module()
    except ImportError:
        return True
    source = oiio.ImageInput.open(str(path))
    if source is None:
        oiio.geterror()
        return False
    try:
        part, whole = 0, True
        while whole and source.seek_subimage(part, 0):
            found = source.read_image(part, 0, 0, source.spec().nchannels, "uint8")
            whole, part = found is not None and not source.geterror(), part + 1
        return whole and part > 0
    finally:
        source.close()


def _is_cut(path: Path) -> bool:
    """Whether a file is a PNG without its last chunk, which libpng may read, or prints a line of its own about."""
    content = path.read_bytes()
    return content.startswith(b"\x89PNG") and b"IEND\xaeB`\x82" not in content


def _unwritten(path: Path, reason: object) -> OSError:
    return OSError(f"{path}: cannot be written: {reason}")


def _first(reason: str) -> str:
    """The first line of OpenImageIO's reason."""
    return (reason.strip().splitlines() or ["it is no picture, or incomplete"])[0]
