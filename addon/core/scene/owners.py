# SPDX-License-Identifier: GPL-3.0-or-later
"""The objects of triangles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..base.arrays import I32
    from .scene import Source


def owners(sources: tuple[Source, ...], triangles: I32) -> set[str]:
    """Names of the objects that triangles, (t,) indices, belong to. sources: as in Geometry."""
    runs = [(source.count, name) for source in sources for name in source.names]
    ends = np.cumsum([count for count, _ in runs])
    return {
        runs[run][1] for run in np.unique(np.searchsorted(ends, triangles, side="right")).tolist() if run < len(runs)
    }
