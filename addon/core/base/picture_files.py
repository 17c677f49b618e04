# SPDX-License-Identifier: GPL-3.0-or-later
"""Atomic writing of picture files, because Blender reports no error when the disk fills up while it writes one."""

from __future__ import annotations

import contextlib
import os
import tempfile
import zlib
from collections.abc import Iterator
from pathlib import Path

PNG = b"\x89PNG\r\n\x1a\n"
JPEG_BEGIN, JPEG_END = b"\xff\xd8", b"\xff\xd9"


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path for a picture in the folder of `path`, with its suffix; renamed to `path` only if it is
    complete.

    An older picture stays until then. Raises OSError, which names the file; exceptions of the body pass through.
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
    """Whether a .png has all its chunks with valid checksums, or a .jpg its end marker. Raises OSError."""
    data = path.read_bytes()
    if data.startswith(JPEG_BEGIN):
        return data.endswith(JPEG_END)
    return data.startswith(PNG) and _chunks_are_whole(memoryview(data)[len(PNG) :])


def _chunks_are_whole(rest: memoryview) -> bool:
    """Whether these are the chunks of a PNG up to IEND: length, kind, content, checksum of the latter two."""
    while len(rest) >= 12:
        end = 8 + int.from_bytes(rest[:4], "big")
        kind = bytes(rest[4:8])
        if zlib.crc32(rest[4:end]) != int.from_bytes(rest[end : end + 4], "big") or len(rest) < end + 4:
            return False
        if kind == b"IEND":
            return True
        rest = rest[end + 4 :]
    return False


def _unwritten(path: Path, reason: object) -> OSError:
    return OSError(f"{path}: cannot be written: {reason}")
