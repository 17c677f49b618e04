# SPDX-License-Identifier: GPL-3.0-or-later
"""All claims, paper by paper. To add a paper, write `claims_NAME.py` with a constant `CLAIMS` and add it to PAPERS."""

from __future__ import annotations

from . import claims_beams, claims_intervals, claims_kd, claims_shadows, claims_thesis
from .claims import Claim

PAPERS = (claims_kd, claims_intervals, claims_beams, claims_shadows, claims_thesis)
"""The papers' modules, in the order of the report."""

CLAIMS: tuple[Claim, ...] = tuple(claim for paper in PAPERS for claim in paper.CLAIMS)
