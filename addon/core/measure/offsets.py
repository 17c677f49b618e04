# SPDX-License-Identifier: GPL-3.0-or-later
"""Wrong answers against the distance from the origin: the grid of touching boxes with its rays, moved away.

Every structure is tested as it is and, where its traversal has error bounds, also without them (`robust=none`): the
difference shows the effect of the bounds, and that the check can fail.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..scene import grid
from ..structures import specs
from . import accuracy
from .accuracy import Answers

if TYPE_CHECKING:
    from ..base.interface import Native

OFFSETS = (0.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6)
"""Distances along each axis, in sides of a box; at the last one floats are a sixteenth apart."""

BOXES = 4
RAYS = 8192

UNGUARDED = "robust=none"


class Moved:
    """The moved grids and brute force's answers on them, made once for all structures."""

    def __init__(self, native: Native, offsets: Sequence[float], seed: int) -> None:
        self._native = native
        self._places = []
        boxes = grid.workload(BOXES, RAYS, seed)
        (walls,) = boxes.extra
        for offset in offsets:
            # Not along a diagonal, and with a part that binary numbers cannot represent exactly.
            shift = (offset + (0.1 if offset else 0.0)) * np.array([1.0, -1.0, 0.5])
            vertices = (boxes.vertices + shift).astype(np.float32)
            origins = (walls.origins + shift).astype(np.float32)
            brute = native.build(vertices, boxes.triangles, "brute")
            expected = Answers.of(brute.closest(origins, walls.directions))
            self._places.append((offset, vertices, boxes.triangles, origins, walls.directions, expected))

    def errors(self, spec: str) -> list[dict[str, float]]:
        """One entry per offset: number of rays, and errors with and without the bounds; None where there are none.

        Raises the exceptions of a build.
        """
        walks = {"": spec, "_unguarded": unguarded(spec, self._native.structures())}
        found = []
        # Compare with and without bounds at each offset.
        for offset, vertices, triangles, origins, directions, expected in self._places:
            entry: dict[str, Any] = {"offset": offset, "rays": len(origins)}
            for suffix, walked in walks.items():
                if walked is None:
                    entry |= {f"false_miss{suffix}": None, f"wrong{suffix}": None}
                    continue
                structure = self._native.build(vertices, triangles, walked)
                answers = Answers.of(structure.closest(origins, directions))
                errors = accuracy.compare(expected, answers, None, self._native.ulp_distance, bitwise=True)
                entry |= {f"false_miss{suffix}": errors.false_miss, f"wrong{suffix}": errors.wrong}
            found.append(entry)
        return found


def is_unguarded(spec: str) -> bool:
    """Whether the configuration itself disables its error bounds."""
    return UNGUARDED.partition("=")[::2] in specs.pairs(spec)


def unguarded(spec: str, structures: Sequence[Any]) -> str | None:
    """The same configuration without its error bounds; None if it has none or sets `robust` itself."""
    if "robust" not in specs.values(spec, structures) or "robust=" in spec:
        return None
    return spec + ("," if ":" in spec else ":") + UNGUARDED
