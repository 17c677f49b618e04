# SPDX-License-Identifier: GPL-3.0-or-later
"""Identities and metadata of Cryptomatte, by its specification 1.2 (Friedman and Jones 2015, "Fully automatic ID mattes
with support for motion blur and transparency").
"""

from __future__ import annotations

import json
from collections.abc import Iterable

import numpy as np

from .arrays import F32

_WORD = 0xFFFFFFFF


def murmur3(name: str) -> int:
    """The 32-bit MurmurHash3 (Appleby) of a name in UTF-8, with the seed 0."""
    data = name.encode()
    value = 0
    # Mix in the name four bytes at a time, the first byte least; the last word may be shorter.
    for start in range(0, len(data), 4):
        chunk = data[start : start + 4]
        word = int.from_bytes(chunk, "little") * 0xCC9E2D51 & _WORD
        value ^= _rotated(word, 15) * 0x1B873593 & _WORD
        if len(chunk) == 4:
            value = _rotated(value, 13) * 5 + 0xE6546B64 & _WORD
    # Spread the bits.
    value ^= len(data)
    value = (value ^ value >> 16) * 0x85EBCA6B & _WORD
    value = (value ^ value >> 13) * 0xC2B2AE35 & _WORD
    return value ^ value >> 16


def _rotated(word: int, bits: int) -> int:
    return (word << bits | word >> 32 - bits) & _WORD


def identity(name: str) -> int:
    """The bits of the float of a name in pictures: its hash, with an exponent of a normal number."""
    value = murmur3(name)
    exponent = min(max(value >> 23 & 0xFF, 1), 254)
    return value & 0x807FFFFF | exponent << 23


def identities(names: Iterable[str]) -> F32:
    """(n,) float32: the float of each name."""
    names = list(names)
    found = {name: identity(name) for name in set(names)}
    return np.array([found[name] for name in names], np.uint32).view(np.float32)


def metadata(layer: str, names: Iterable[str]) -> dict[str, str]:
    """The metadata of a layer such as "ViewLayer.CryptoObject", for the header of a file.

    The manifest gives the bits of the float of each name in the layer.
    """
    key = f"cryptomatte/{murmur3(layer):08x}"[: len("cryptomatte/") + 7]
    manifest = {name: f"{identity(name):08x}" for name in sorted(set(names))}
    return {
        f"{key}/name": layer,
        f"{key}/hash": "MurmurHash3_32",
        f"{key}/conversion": "uint32_to_float32",
        f"{key}/manifest": json.dumps(manifest, separators=(",", ":"), ensure_ascii=False),
    }
