# SPDX-License-Identifier: GPL-3.0-or-later
"""How long a picture takes: rounds of small pictures, interleaved over all configurations, as rays are timed.

Embree makes no pictures, so another tree is timed beside: the one that made the rays, in each round at its beginning
and at its end. It relates rounds of other hours and machines, and its two times tell the machine's noise.
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
"""A timed picture may take about so long in any case, and otherwise as long as a timed pass over rays."""

RAYS_PER_SECOND = 8e6
"""By which is reckoned how many samples that allows. It does not depend on the structure or the machine: what a picture
takes besides its samples must weigh alike in all times that are compared."""

LONGEST = 5
"""A configuration whose picture takes this many times longer is not made again, and its time ranks nothing."""


@dataclass
class Rounds:
    """Of one group of configurations. samples, pixels: of the picture that is timed, the samples per pixel. seconds: by
    configuration, one per round, of the picture that is told of (`Curve.whole`). anchor: the tree beside; first, last:
    its seconds in each round.
    """

    anchor: str | None = None
    samples: int = 0
    pixels: int = 0
    seconds: dict[str, list[float]] = field(default_factory=dict)
    first: list[float] = field(default_factory=list)
    last: list[float] = field(default_factory=list)

    def of(self, candidate: Candidate) -> ImageColumns | None:
        """What a row tells of these rounds; None for a configuration that was too slow for them."""
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
    """Fill `found`, a picture between two items: what comes next. The first round warms up.

    anchor: the tree beside, None where there is none. Pictures that differ from those of other structures count among
    the candidates' `differing_pixels`.
    """
    limit = max(options.pass_seconds, PASS_SECONDS)
    few = min(pictures.samples)
    samples = max((n for n in pictures.samples if pictures.rays(n) <= limit * RAYS_PER_SECOND), default=few)
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


def told(pictures: Curve, candidate: Candidate, rounds: ImageColumns | None) -> Spread:
    """Smallest, median and largest seconds of the picture that is told of; without rounds those of the one that was."""
    if rounds is not None:
        return spread(rounds["rounds_s"])
    last = candidate.curve[-1]
    return spread([pictures.whole(float(last["seconds"] or 0.0), int(last["spp"] or 1))])
