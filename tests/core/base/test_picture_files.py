# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that are whole or not there, whatever Blender says of a full disk."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import pytest

from addon.core.base import picture_files

Chunks = list[tuple[bytes, bytes]]


def png(*, chunks: Chunks | None = None) -> bytes:
    """One grey pixel."""
    parts = chunks or [
        (b"IHDR", struct.pack(">IIBBBBB", 1, 1, 8, 0, 0, 0, 0)),
        (b"IDAT", zlib.compress(b"\0\x80")),
        (b"IEND", b""),
    ]
    made = picture_files.PNG
    for kind, content in parts:
        made += struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
    return made


JPEG = b"\xff\xd8\xff\xe0 some picture \xff\xd9"


@pytest.mark.parametrize(("name", "whole"), [("a.png", png()), ("a.jpg", JPEG)])
def test_a_whole_picture_takes_its_name(name: str, whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(b"old")
    with picture_files.replacing(path) as fresh:
        assert fresh.suffix == path.suffix
        fresh.write_bytes(whole)
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == whole
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(("name", "whole"), [("a.png", png()), ("a.jpg", JPEG)])
def test_a_part_of_a_picture_leaves_the_old_one(name: str, whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(b"old")
    for length in range(len(whole)):
        with pytest.raises(OSError, match="incomplete") as told, picture_files.replacing(path) as fresh:
            fresh.write_bytes(whole[:length])
        assert str(told.value).startswith(f"{path}: cannot be written: ")
        assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_picture_with_a_damaged_part_is_no_picture(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    whole = png()
    for place in range(len(whole)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        assert not picture_files.is_whole(path)


def test_what_was_not_written_is_told_with_the_picture_s_name(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    with pytest.raises(OSError, match="nothing was written") as told, picture_files.replacing(path):
        pass
    assert str(told.value).startswith(f"{path}: ")
    nowhere = tmp_path / "nowhere" / "a.png"
    with pytest.raises(OSError, match="cannot be written: No such file") as told, picture_files.replacing(nowhere):
        pass
    assert str(told.value).startswith(f"{nowhere}: ")
