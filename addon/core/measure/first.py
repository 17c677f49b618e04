# SPDX-License-Identifier: GPL-3.0-or-later
"""The time to the first picture: a build, and one pass over the camera rays right after it.

Trees that rays have built (`lazy=1`) do part of the work of the build in that pass, so neither time alone says what
they cost. The answers of each pass are compared bit for bit with those of the first configuration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..scene.rays import RaySet
from . import timing, yardstick
from .accuracy import Answers, differing
from .rows import is_lazy
from .timing import Candidate

if TYPE_CHECKING:
    from .yardstick import Traced

SECONDS = 2.0
"""Structures whose pass would take longer are left out."""


def rounds(
    build: Callable[[str], tuple[Traced, float]], group: Sequence[Candidate], view: RaySet, repeats: int, threads: int
) -> Iterator[str]:
    """Time builds with their first pass, one between two items: what comes next. Nothing where no tree is lazy.

    build: a structure of a configuration, and the seconds that it took. Fills `first_seconds`, and adds rays whose
    answers differ from those of the first configuration to `differing_pixels`.
    """
    ours = [c for c in group if c.spec != yardstick.SPEC and c.seconds.get(view.name)]
    able = [c for c in ours if len(view) <= float(np.median(c.mrays(view.name))) * 1e6 * SECONDS]
    if not any(is_lazy(candidate.spec) for candidate in able):
        return
    options = view.options(threads)
    right: list[Answers] = []
    now = timing.clock(threads)
    for number in range(repeats):
        for candidate in able:
            yield f"{candidate.spec}: build and first picture, round {number + 1} of {repeats}"
            structure, seconds = build(candidate.spec)
            start = now()
            hits = structure.closest(view.origins, view.directions, **options)
            candidate.first_seconds.append(seconds + now() - start)
            answers = Answers.of(hits)
            right = right or [answers]
            candidate.differing_pixels += int(differing(right[0], answers, None).sum())
