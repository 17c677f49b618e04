# SPDX-License-Identifier: GPL-3.0-or-later
"""Which kinds of planes a structure has, and the levels that can be seen through when it is shown at first."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from . import planes

if TYPE_CHECKING:
    from ..base.interface import Structure

FETCHED, DEEPEST = 60_000, 60
"""Number of polygons, shallowest first, and depth, by which a structure is judged."""

MOST_SHOWN = 1500
"""Number of polygons up to which levels are shown at first."""


@dataclass(frozen=True, eq=False)
class Survey:
    """kinds: names of planes that occur, in the order of KINDS. counts, crossings: (depths,), number of polygons of
    each depth, and of those that a random line crosses.
    """

    kinds: tuple[str, ...]
    counts: NDArray[np.int64]
    crossings: F64

    def first(self) -> tuple[int, int]:
        """The range of depths to show at first: from the root to the last one that keeps the view clear, but at least
        to the first one that has polygons.
        """
        if not len(self.counts):
            return 0, 0
        clear = (np.cumsum(self.crossings) <= planes.CLEAR) & (np.cumsum(self.counts) <= MOST_SHOWN)
        last = len(clear) - 1 if clear.all() else int(np.argmin(clear)) - 1
        return 0, max(last, int(np.argmax(self.counts > 0)))


def survey(structure: Structure) -> Survey:
    """Look at the shallow planes of a native structure."""
    found = structure.split_polygons(DEEPEST, FETCHED)
    kinds, depths = found["kind"], found["depth"].astype(np.int64)
    if not len(kinds):
        return Survey((), np.zeros(0, np.int64), np.zeros(0))
    each = planes.crossings(found["vertices"], found["offsets"])
    occurring = {int(kind) for kind in np.unique(kinds)}
    if found["hidden"] and structure.statistics["nodes_oblique"]:
        occurring.add(planes.KINDS.index("OBLIQUE"))
    names = tuple(planes.KINDS[kind] for kind in sorted(occurring))
    return Survey(names, np.bincount(depths), np.bincount(depths, each))
