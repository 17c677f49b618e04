# SPDX-License-Identifier: GPL-3.0-or-later
"""Planes against boxes: whether kd-trees or hierarchies of boxes answer rays sooner, and in which scenes.

Both studies compare textbook trees with two children a node: the faithful configuration, in which rays go one by one
and test one triangle at a time. The best one lets each family go as fast as it can. Depth complexity is measured: the
number of triangles that a camera ray meets if none stops it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from ...core.scene.rays import blocks
from ...core.scene.workload import Workload
from . import kd, paper_scenes
from .claims import UNTESTED, Chart, Claim, Lab, Outcome, Share, Timing, verdict

RIVERA = (
    "Rivera-Alvarado and Zamora-Madrigal, An evaluation of Kd-Trees vs Bounding Volume Hierarchy (BVH) acceleration "
    "structures in modern CPU architectures (2023)"
)
VINKLER = (
    "Vinkler, Havran and Bittner, Performance comparison of bounding volume hierarchies and kd-trees for GPU ray "
    "tracing (2016)"
)

PAIRS = {
    "faithful": ("kd-sah:traversal=dir,leaves=scalar", "bvh-sah:traversal=ordered,width=2,leaves=scalar"),
    "best": ("kd", "bvh-sah"),
}
"""A tree of planes and one of boxes for each configuration."""

SCENES = ("stanford-bunny", "sponza-dabrovic", "conference", "country-kitchen", "sanmiguel-leaves")
"""Shared scenes: one closed surface, two halls, a furnished room and leaves in front of leaves."""

SLOW = "country-kitchen"
"""The scene whose unclipped kd-tree takes most memory and time; a quick run leaves it out."""

DEPTHS = (0.5, 2.0, 8.0, 32.0)
"""Depth complexity of the scenes of the series, about."""

SAMPLE = 4096
"""Camera rays whose hits are counted."""


@dataclass(frozen=True)
class Scene:
    """The measurements of a scene. depth: triangles that a camera ray meets. found, bytes: by configuration."""

    workload: Workload
    depth: float
    found: Mapping[str, Timing]
    bytes: Mapping[str, int]

    def share(self, configuration: str) -> Share:
        """The time of planes divided by that of boxes."""
        planes, boxes = PAIRS[configuration]
        return self.found[planes].share(self.found[boxes])

    def why(self, configuration: str) -> str:
        """The work of a ray in both trees, and their memory."""
        parts = (
            f"{spec} {self.found[spec].counters['steps']:.1f} nodes, {self.found[spec].counters['tests']:.1f} tests, "
            f"{self.bytes[spec] / 1e6:.2f} MB"
            for spec in PAIRS[configuration]
        )
        return f"{self.workload.name}, depth complexity {self.depth:.1f}, per ray: {'; '.join(parts)}"


def scenes(lab: Lab, chosen: Sequence[Workload]) -> list[Scene]:
    """The measurements of these scenes, by rising depth complexity; scenes that no ray hits are left out."""
    specs = [spec for pair in PAIRS.values() for spec in pair]
    made = []
    for workload in chosen:
        sets = kd.ray_sets(lab, workload)
        if not any(some.name.startswith("diffuse") for some in sets):
            continue
        view = sets[0].take(blocks(len(sets[0]), SAMPLE, seed=1))
        hits = lab.build(workload, "kd").count_hits(view.origins, view.directions)
        found = kd.times(lab, workload, specs, alone=False)
        sizes = {spec: int(lab.statistics(workload, spec)["bytes"]) for spec in specs}
        made.append(Scene(workload, float(hits.mean()), found, sizes))
    return sorted(made, key=lambda one: one.depth)


def kinds(lab: Lab) -> Iterator[tuple[str, list[Scene]]]:
    """The series of equally many triangles, then the shared scenes that exist; a quick run leaves out the SLOW one."""
    yield "series of 8,000 triangles", scenes(lab, [paper_scenes.layered(depth) for depth in DEPTHS])
    shared = [found for name in SCENES if (found := lab.shared(name)) is not None and not (lab.quick and name == SLOW)]
    yield "shared scenes", scenes(lab, shared)


def planes_ahead(lab: Lab) -> Iterator[Outcome]:
    """The time of planes against that of boxes, scene by scene."""
    for kind, found in kinds(lab):
        for one in found:
            for configuration, pair in PAIRS.items():
                share = one.share(configuration)
                planes, boxes = (one.found[spec].nanoseconds for spec in pair)
                tests = [one.found[spec].counters["tests"] for spec in pair]
                yield Outcome(
                    configuration,
                    share.below(),
                    f"{one.workload.name} ({kind}): {pair[0]} takes {share.value:.2f} of the time of {pair[1]} "
                    f"({planes:.0f} and {boxes:.0f} ns a ray)",
                    one.why(configuration),
                    lab.error(one.workload, pair),
                    {
                        "ratio": share.value,
                        "depth": one.depth,
                        "tests": tests[0] / max(tests[1], 1e-9),
                        "memory": one.bytes[pair[0]] / one.bytes[pair[1]],
                    },
                )


def planes_in_depth(lab: Lab) -> Iterator[Outcome]:
    """Whether boxes are ahead in the scene of least depth complexity, and planes in that of most."""
    for kind, found in kinds(lab):
        for configuration, pair in PAIRS.items():
            if len(found) < 2:
                yield Outcome(configuration, UNTESTED, f"{kind}: fewer than two are there")
                continue
            shares = [one.share(configuration) for one in found]
            points = [(one.depth, share.value) for one, share in zip(found, shares, strict=True)]
            told = ", ".join(
                f"{one.workload.name} ({depth:.1f}) {ratio:.2f}"
                for one, (depth, ratio) in zip(found, points, strict=True)
            )
            yield Outcome(
                configuration,
                verdict(shares[0].above(), shares[-1].below()),
                f"{kind}, by depth complexity: {pair[0]} takes these shares of the time of {pair[1]}: {told}",
                f"{found[0].why(configuration)}. {found[-1].why(configuration)}",
                lab.errors([one.workload.name for one in found], pair),
                {f"ratio at {depth:.2f}": ratio for depth, ratio in points},
                (
                    Chart(
                        f"{configuration}: {kind}",
                        "depth complexity",
                        f"time of {pair[0]} / {pair[1]}",
                        {pair[0]: points},
                        level=(1.0, pair[1]),
                    ),
                ),
            )


CLAIMS = (
    Claim(
        "planes-ahead",
        RIVERA,
        "On a CPU, kd-trees are faster than hierarchies of boxes in all scenes.",
        planes_ahead,
        SCENES,
    ),
    Claim(
        "planes-in-depth",
        VINKLER,
        "Boxes are faster in simple scenes, kd-trees in complex ones, above all in those of high depth complexity.",
        planes_in_depth,
        SCENES,
    ),
)
