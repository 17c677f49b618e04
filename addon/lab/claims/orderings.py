# SPDX-License-Identifier: GPL-3.0-or-later
"""What the makers of tinybvh and Embree publish about the order of their own modes, and of each other.

Each tracer is called as its users call it, ray by ray or in its packets. What the crate `native/peers` has is measured
with `--peers` only; Embree's own modes come with embreex. Their arithmetic differs from ours: only other hits count as
wrong answers.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...core.measure import accuracy, yardstick
from ...core.measure.accuracy import Errors
from ...core.scene.rays import RaySet
from ...core.scene.workload import Workload
from . import kd, paper_scenes
from .claims import UNTESTED, Checked, Claim, Lab, Outcome, Share, verdict

TINYBVH = "Bikker, TinyBVH (README, version 1.7)"
EMBREE = "Intel, Embree 4 API reference (rtcSetSceneBuildQuality, rtcSetSceneFlags)"

SCENES = ("stanford-bunny", "sponza-dabrovic", "conference")


@dataclass(frozen=True)
class Timed:
    """Median seconds of a tracer on a ray set, seconds of its build, and the errors of its answers."""

    seconds: float
    build: float
    errors: Errors


def scenes(lab: Lab) -> list[Workload]:
    """A generated scene and the shared ones that exist."""
    shared = (lab.shared(name) for name in SCENES)
    return [paper_scenes.scattered(), *(workload for workload in shared if workload is not None)]


def lacks(specs: Sequence[str]) -> str:
    """The reason why one of these cannot be measured, or ""."""
    if any(spec in yardstick.MODES for spec in specs) and (reason := yardstick.problem()):
        return reason
    missing = [spec for spec in specs if spec not in yardstick.MODES and spec not in yardstick.MAKERS]
    return f"{', '.join(missing)}: --peers names them" if missing else ""


def built(workload: Workload, spec: str) -> yardstick.Foreign:
    """A foreign structure over a scene."""
    if spec in yardstick.MODES:
        return yardstick.EmbreeStructure(workload.vertices, workload.triangles, robust=yardstick.MODES[spec])
    return yardstick.MAKERS[spec](workload.vertices, workload.triangles)


def measured(lab: Lab, workload: Workload, specs: Sequence[str], some: RaySet) -> dict[str, Timed]:
    """The tracers on one ray set, in turns; the first round only warms up."""
    lab.say(f"{workload.name}: {some.name}: {', '.join(specs)}")
    tracers = {spec: built(workload, spec) for spec in specs}
    asked: dict[str, Callable[[], object]] = {spec: tracer.timed(some) for spec, tracer in tracers.items()}
    taken: dict[str, list[float]] = {spec: [] for spec in specs}
    for repeat in range(lab.repeats + 1):
        for spec, ask in asked.items():
            start = time.process_time()
            ask()
            if repeat:
                taken[spec].append(time.process_time() - start)
    # Compare the nearest hits of a sample with brute force.
    part, right = lab.right(workload, some)
    found = {}
    for spec, tracer in tracers.items():
        answers = tracer.closest(part.origins, part.directions, t_max=part.t_max)
        errors = accuracy.compare(right, answers, None, lab.native.ulp_distance, bitwise=False)
        build = float(tracer.statistics["build_seconds"])
        found[spec] = Timed(float(np.median(taken[spec])), build, errors)
    return found


@dataclass(frozen=True)
class Order:
    """A published order of two tracers. sets: names of the ray sets it is about. build: whether the quicker one is also
    said to build more slowly. why: what explains it, as neither counts its work.
    """

    id: str
    paper: str
    statement: str
    quicker: str
    slower: str
    why: str
    sets: tuple[str, ...] = kd.SETS
    build: bool = False

    def claim(self) -> Claim:
        """The claim that it holds."""
        return Claim(self.id, self.paper, self.statement, self.outcomes, SCENES)

    def outcomes(self, lab: Lab) -> Iterator[Outcome]:
        """The times of both, scene by scene and set by set."""
        chosen = scenes(lab)
        if reason := lacks([self.quicker, self.slower]):
            yield Outcome("faithful", UNTESTED, reason)
            return
        for workload in chosen:
            for some in kd.ray_sets(lab, workload):
                if some.name.split(" ")[0] in self.sets:
                    yield self._outcome(lab, workload, some)

    def _outcome(self, lab: Lab, workload: Workload, some: RaySet) -> Outcome:
        found = measured(lab, workload, [self.quicker, self.slower], some)
        own, other = found[self.quicker], found[self.slower]
        shares = {
            "rays": Share.of(own.seconds / other.seconds),
            "build": Share.of(own.build / max(other.build, 1e-9)),
        }
        each = " and ".join(f"{1e9 * one.seconds / len(some):.0f}" for one in (own, other))
        return Outcome(
            "faithful",
            verdict(shares["rays"].below(), *([shares["build"].above()] if self.build else [])),
            f"{workload.name}, {some.name}: {self.quicker} takes {shares['rays'].value:.2f} of the time of "
            f"{self.slower} ({each} ns a ray), {shares['build'].value:.2f} of its build",
            self.why,
            Checked.of((self.quicker, self.slower), (own.errors, other.errors)),
            {name: share.value for name, share in shares.items()},
        )


CLAIMS = (
    Order(
        "tinybvh-widest",
        TINYBVH,
        "Eight children a node are the fastest form on a CPU.",
        "peer-tinybvh-bvh8",
        "peer-tinybvh-bvh",
        "tinybvh counts nothing; a node of eight boxes is one step of AVX2, and the binary tree has three for it",
    ).claim(),
    Order(
        "tinybvh-primary",
        TINYBVH,
        "Single primary rays are traced faster than by Embree.",
        "peer-tinybvh-bvh8",
        "embree:robust=none",
        "neither counts steps or tests; both have eight children a node and go ray by ray, Embree through embreex",
        ("primary",),
    ).claim(),
    Order(
        "embree-quality",
        EMBREE,
        "A higher build quality renders faster and builds slower.",
        "peer-embree-best",
        "peer-embree-packets",
        "Embree counts nothing; the high quality splits triangles in space, and this mode is not robust either: "
        "`embree-robust` has that part alone",
        build=True,
    ).claim(),
    Order(
        "embree-robust",
        EMBREE,
        "The robust mode leaves optimizations out; without it rays are faster.",
        "embree:robust=none",
        "embree",
        "Embree counts nothing; the robust mode widens the intervals of boxes and tests watertight triangles",
    ).claim(),
)
