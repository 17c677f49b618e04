# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole tree and its triangles as arrays of a NumPy archive, for programs without Halfspace.

`docs/trees.md` describes every array.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...core.base.arrays import F32, I32

if TYPE_CHECKING:
    from ...core.base.interface import Structure

FORMAT = 1
"""Version of the arrays; it changes if the meaning of one does."""

LEAF = 7
"""`node_kind` of leaves."""


def arrays(structure: Structure, name: str, vertices: F32, triangles: I32) -> dict[str, NDArray[Any]]:
    """The arrays of the tree of a structure over these triangles, with them. name: of the scene."""
    found: dict[str, NDArray[Any]] = {key: np.asarray(value) for key, value in structure.export().items()}
    found["format"] = np.array(FORMAT, np.int64)
    found["spec"] = np.array(structure.spec)
    found["scene"] = np.array(name)
    found["scene_vertices"] = vertices
    found["scene_triangles"] = triangles
    return found


def packed(found: Mapping[str, NDArray[Any]]) -> bytes:
    """The archive; the same arrays make the same bytes."""
    written = io.BytesIO()
    # NumPy 1.26 would write the option allow_pickle as one more array.
    content: dict[str, Any] = dict(found)
    np.savez_compressed(written, **content)
    return written.getvalue()
