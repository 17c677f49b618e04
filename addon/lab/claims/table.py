# SPDX-License-Identifier: GPL-3.0-or-later
"""All claims, paper by paper. To add one, write `NAME.py` here with a constant `CLAIMS`, and extend PAPERS."""

from __future__ import annotations

from . import (
    any_hits,
    beams,
    families,
    growth,
    interval_forms,
    intervals,
    kd,
    medians,
    mirrors,
    moving,
    orderings,
    oriented,
    polygons,
    rbsp,
    shadows,
    thesis,
    thesis_trees,
    voxels,
)
from .claims import Claim

PAPERS = (
    kd,
    intervals,
    interval_forms,
    moving,
    beams,
    polygons,
    shadows,
    any_hits,
    mirrors,
    thesis,
    thesis_trees,
    rbsp,
    medians,
    voxels,
    oriented,
    families,
    orderings,
    growth,
)
"""The papers' modules, in the order of the report."""

CLAIMS: tuple[Claim, ...] = tuple(claim for paper in PAPERS for claim in paper.CLAIMS)
