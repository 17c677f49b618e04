# SPDX-License-Identifier: GPL-3.0-or-later
"""Picture times: rounds of small pictures, interleaved over all configurations like the rounds of rays.

Embree renders no pictures, so another tree is timed as the anchor: the one that made the rays, at the beginning and at
the end of each round. It relates rounds of other hours and machines, and its two times give the machine's noise.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from .curve import Curve
from .rows import ImageColumns, Spread, spread
from .timing import Candidate

if TYPE_CHECKING:
    from ..base.interface import Structure
    from .preparation import Options

PASS_SECONDS = 0.1
"""Smallest limit on the seconds of a timed picture. If the limit of a timed pass over rays is larger, it holds."""

RAYS_PER_SECOND = 8e6
"""Nominal speed from which the number of samples is derived. It must not depend on structure or machine: the constant
cost of a picture has to weigh the same in all times that are compared.
"""

LONGEST = 5
"""Factor over that limit beyond which a configuration's picture is not repeated and its time is not ranked."""


@dataclass
class Rounds:
    """Rounds of one group of configurations.

    samples, pixels: of the timed picture. seconds: by configuration, one per round, of the reported picture
    (`Curve.whole`). anchor: configuration of the anchor; first, last: its seconds at both ends of each round.
    """

    anchor: str | None = None
    samples: int = 0
    pixels: int = 0
    seconds: dict[str, list[float]] = field(default_factory=dict)
    first: list[float] = field(default_factory=list)
    last: list[float] = field(default_factory=list)

    def of(self, candidate: Candidate) -> ImageColumns | None:
        """The entry of these rounds in a row; None for a configuration that was too slow for them."""
        rounds = self.seconds.get(candidate.spec)
        if not rounds:
            return None
        return {
            "samples": self.samples,
            "pixels": self.pixels,
            "anchor": self.anchor,
            "rounds_s": rounds,
            "anchor_rounds_s": self.first,
            "noise": self._noise(),
        }

    def _noise(self) -> float | None:
        """The typical relative difference between two times of the same picture in the same round."""
        if not self.last:
            return None
        return float(np.expm1(np.median(np.abs(np.log(np.divide(self.last, self.first))))))


def time(
    found: Rounds, pictures: Curve, anchor: Structure | None, candidates: Sequence[Candidate], options: Options
) -> Iterator[str]:
    """Fill `found`; yields the text of each step, one picture per step. The first round is a warm-up.

    anchor: the anchor's structure, or None. Pixels that differ from other structures' pictures are added to the
    candidates' `differing_pixels`.
    """
    limit = max(options.pass_seconds, PASS_SECONDS)
    # Choose the largest picture within the limit, and drop configurations that are too slow for it.
    fewest = min(pictures.samples)
    samples = max((n for n in pictures.samples if pictures.rays(n) <= limit * RAYS_PER_SECOND), default=fewest)
    width, height, found.samples = pictures.finer(samples)
    found.pixels = width * height
    drawn = {
        candidate.spec: float(point["seconds"] or 0.0)
        for candidate in candidates
        for point in candidate.curve
        if point["spp"] == samples
    }
    able = [one for one in candidates if drawn.get(one.spec, np.inf) <= LONGEST * limit]
    if not able:
        return
    found.anchor = None if anchor is None else anchor.spec
    # Run the rounds, with the anchor at both ends of each.
    for number in range(options.repeats + 1):
        where = f"round {number} of {options.repeats}" if number else "warming up"
        if anchor is not None:
            yield f"{anchor.spec}: keeping time for pictures, {where}"
            seconds, _ = pictures.timed(anchor, samples, options.threads)
            found.first += [seconds] if number else []
        for candidate in able:
            yield f"{candidate.spec}: timing a picture, {where}"
            seconds, differing = pictures.timed(candidate.native, samples, options.threads)
            candidate.differing_pixels += differing
            if number:
                found.seconds.setdefault(candidate.spec, []).append(seconds)
        if anchor is not None and number:
            yield f"{anchor.spec}: keeping time for pictures again, {where}"
            found.last.append(pictures.timed(anchor, samples, options.threads)[0])


def picture_seconds(pictures: Curve, candidate: Candidate, rounds: ImageColumns | None) -> Spread:
    """Smallest, median and largest seconds of the reported picture; without rounds predicted from the last picture of
    the candidate's curve.
    """
    if rounds is not None:
        return spread(rounds["rounds_s"])
    last = candidate.curve[-1]
    return spread([pictures.whole(float(last["seconds"] or 0.0), int(last["spp"] or 1))])
