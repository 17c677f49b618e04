# SPDX-License-Identifier: GPL-3.0-or-later
"""Time to the first picture: a build and one pass over the camera rays right after it.

Lazily built trees (`lazy=1`) defer part of the build to that pass, so neither time alone gives their cost. The answers
of each pass are compared bit for bit with those of the first configuration.
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
"""Limit on the expected time of one pass; slower structures are left out."""


def rounds(
    build: Callable[[str], tuple[Traced, float]], group: Sequence[Candidate], view: RaySet, repeats: int, threads: int
) -> Iterator[str]:
    """Time builds with their first pass over `view`; yields the text of the next step. Does nothing without a lazy
    tree.

    build: returns a structure for a configuration and the seconds its build took. Appends to `first_seconds`, and adds
    the rays whose answers differ from those of the first configuration to `differing_pixels`.
    """
    ours = [c for c in group if not yardstick.is_foreign(c.spec) and c.seconds.get(view.name)]
    able = [c for c in ours if len(view) <= float(np.median(c.mrays(view.name))) * 1e6 * SECONDS]
    if not any(is_lazy(candidate.spec) for candidate in able):
        return
    options = view.options(threads)
    expected: list[Answers] = []
    now = timing.clock(threads)
    # Visit every configuration once per round, so that drift of the machine's speed affects all of them equally.
    for number in range(repeats):
        for candidate in able:
            yield f"{candidate.spec}: build and first picture, round {number + 1} of {repeats}"
            structure, seconds = build(candidate.spec)
            start = now()
            hits = structure.closest(view.origins, view.directions, **options)
            candidate.first_seconds.append(seconds + now() - start)
            answers = Answers.of(hits)
            expected = expected or [answers]
            candidate.differing_pixels += int(differing(expected[0], answers, None).sum())
