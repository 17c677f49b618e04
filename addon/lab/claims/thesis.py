# SPDX-License-Identifier: GPL-3.0-or-later
"""Hoobergs 2019: planes in other directions than the axes, against a kd-tree.

*faithful* uses the thesis's costs, ties, rules and draws, and tests one triangle at a time, against a kd-tree built
with the same; *best* is our build. Rays are those of a view, their bounces and their shadow rays. The models are
its leg and conference, and another Sponza; its museum was never published.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from ...core.measure import counting
from ...core.scene.workload import Workload
from . import kd
from .claims import UNTESTED, Chart, Claim, Lab, Outcome, Share, Timing, verdict

PAPER = "Hoobergs, trees of planes along normals (thesis, KU Leuven 2019)"

BASES = {"faithful": "kd-sah:traversal=dir,leaves=scalar", "best": "kd"}
"""The kd-tree that times are relative to."""

RULES = {"faithful": "costs=thesis,ties=pbrt,slab=0,clip=0,traversal=dir,leaves=scalar", "best": ""}
"""Build rules of the trees; their traversal is that of the kd-tree they are compared with."""

SCENES = {"leg": "killeroo-feet", "sponza": "sponza-dabrovic", "conference": "conference"}
MODELS = tuple(SCENES.values())
SLOW = "conference"
"""The scene whose trees take minutes to build."""

NOISE = 0.05
"""Share of the time that is measurement noise. With three directions the thesis's trees equal its kd-tree, yet take
1.01, 0.95 and 0.97 of its time.
"""

TIMES = {
    ("bsp-wn-plus-kd", 6): {"leg": 0.677, "sponza": 0.804, "conference": 0.786},
    ("bsp-cn-plus-kd", 6): {"leg": 0.678, "sponza": 0.803, "conference": 0.793},
    ("bsp-random-plus-kd", 10): {"leg": 0.802, "sponza": 0.855, "conference": 0.871},
}
"""The published medians of seven runs, as shares of the kd-tree's time."""

OTHERS = {
    ("bsp-ize-kd", 0): {"leg": 0.95, "sponza": 1.09, "conference": 0.93},
    ("rbsp-kd", 13): {"leg": 0.84, "sponza": 0.94, "conference": 0.93},
}
"""The published medians of trees of other authors, as shares of the kd-tree's time."""

BVHS = {
    "BVH, two boxes a node": "bvh-sah:width=2,traversal=ordered,leaves=scalar",
    "as Embree, eight boxes and eight triangles at once": "bvh-sah:traversal=ordered",
}
"""Hierarchies of boxes beside the trees, which the thesis does not measure: as a scalar program has them, and as Embree
traces single rays.
"""

BESIDE = dict(zip(("faithful", "best"), BVHS, strict=True))
"""Which of them stands beside the trees of each configuration."""

CHOSEN = (("bsp-wn-plus-kd", 6), ("bsp-cn-plus-kd", 6))
"""The thesis's best trees and their number of directions."""

PLAIN = (("bsp-wn", 6), ("bsp-cn", 6), ("bsp-random", 10), ("bsp-random", 2))
"""Trees without the axes, and their number of directions."""

GAIN_K = (3, 4, 6, 8)
"""Numbers of directions over which the gain of one normal is measured."""

SLOW_RANDOM = 4.4
"""Published time of two random directions on the thesis's Sponza, relative to the kd-tree's."""

BUILDS, IZE_BUILDS = 50.0, 200.0
"""The paper's 'about a hundred times' as a lower limit, and the lower limit for trees after Ize."""


EIGHT = {
    "faithful": "",
    "best": ". Each tested triangle is counted, but eight or sixteen are tested at once: fewer tests save less time "
    "than one by one",
}
"""Remark on counts of tests."""

AXES = 3
"""Number of directions with which trees that try the axes first try only these."""


def spec(configuration: str, tree: tuple[str, int]) -> str:
    """A tree with k directions (0: it has no such parameter) in one of the two configurations."""
    name, k = tree
    rules = RULES[configuration]
    if rules and name.endswith("-kd"):
        # With the axes alone, slabs and the fallback rule of oblique planes have no effect.
        rules = rules.replace("slab=0,", "") if k == AXES else f"{rules},rule=code"
    if rules and k != AXES:
        rules += ",draw=thesis" if name.startswith(("bsp-wn", "bsp-cn")) else ""
        rules += ",empty_clusters=code" if name.startswith("bsp-cn") else ""
    own = ",".join(part for part in (f"k={k}" if k else "", rules) if part)
    return f"{name}:{own}" if own else name


def scenes(lab: Lab) -> Iterator[tuple[str, Workload]]:
    """The shared scenes that exist, under the names of the thesis; a quick run leaves out the SLOW one."""
    for name, ours in SCENES.items():
        workload = lab.shared(ours, published=True)
        if workload is not None and not (lab.quick and name == SLOW):
            yield name, workload


def measured(lab: Lab, workload: Workload, specs: Sequence[str]) -> Mapping[str, Timing]:
    """Each configuration's time over all ray sets, and its mean counters."""
    return kd.times(lab, workload, specs, alone=False)


def shares_of(lab: Lab, workload: Workload, configuration: str, trees: Sequence[tuple[str, int]]) -> list[Share]:
    """Each tree's time as a share of the kd-tree's."""
    base, specs = BASES[configuration], [spec(configuration, tree) for tree in trees]
    found = measured(lab, workload, [base, *specs])
    return [found[one].share(found[base]) for one in specs]


def label(tree: tuple[str, int]) -> str:
    """A tree's name, with k where it has one."""
    return f"{tree[0]} (K={tree[1]})" if tree[1] else tree[0]


def counters(lab: Lab, workload: Workload, configuration: str, trees: Sequence[tuple[str, int]]) -> str:
    """Nodes, leaves and tests per ray, of the kd-tree and of the trees, as text."""
    specs = {BASES[configuration]: BASES[configuration]} | {label(t): spec(configuration, t) for t in trees}
    found = measured(lab, workload, list(specs.values()))
    parts = []
    for name, one in specs.items():
        mean = found[one].counters
        parts.append(f"{name} {mean['steps']:.1f} nodes, {mean['leaves']:.1f} leaves, {mean['tests']:.1f} tests")
    return f"per ray: {'; '.join(parts)}{counting.remark(specs, lab.native)}"


def nowhere(lab: Lab) -> Iterator[Outcome]:
    """An outcome for the case that none of the scenes exists; nothing otherwise."""
    if not any(True for _ in scenes(lab)):
        yield Outcome("best", UNTESTED, "all of the scenes are missing")


def published_times(
    lab: Lab, published: Mapping[tuple[str, int], Mapping[str, float]], *, museum: bool
) -> Iterator[Outcome]:
    """Whether the trees' times relative to the kd-tree are at most the published ones. museum: add its untestable
    outcome. Outcomes also state the time of one of `BVHS`.
    """
    yield from nowhere(lab)
    trees = list(published)
    for name, workload in scenes(lab):
        for configuration, base in BASES.items():
            beside = {BESIDE[configuration]: BVHS[BESIDE[configuration]]}
            found = measured(lab, workload, [base, *(spec(configuration, tree) for tree in trees), *beside.values()])
            shares = [found[spec(configuration, tree)].share(found[base]) for tree in trees]
            others = {text: found[one].share(found[base]).value for text, one in beside.items()}
            text = "; ".join(
                f"{label(tree)} {share.value:.2f} (published: {published[tree][name]:.2f})"
                for tree, share in zip(trees, shares, strict=True)
            ) + "".join(f"; {text} {share:.2f}" for text, share in others.items())
            yield Outcome(
                configuration,
                verdict(*(share.below(published[tree][name]) for tree, share in zip(trees, shares, strict=True))),
                f"{workload.name}: of the time of {base}: {text}",
                counters(lab, workload, configuration, trees),
                lab.error(workload, [base, *(spec(configuration, tree) for tree in trees), *beside.values()]),
                {**{label(tree): share.value for tree, share in zip(trees, shares, strict=True)}, **others},
            )
    if museum:
        yield Outcome("faithful", UNTESTED, "museum: the model was not published")


def tests_and_time(lab: Lab) -> Iterator[Outcome]:
    """Whether two fifths of the tests and a fifth of the time are saved."""
    yield from nowhere(lab)
    for name, workload in scenes(lab):
        for configuration, base in BASES.items():
            specs = {label(tree): spec(configuration, tree) for tree in CHOSEN}
            found = measured(lab, workload, [base, *specs.values()])
            tests = {k: found[s].counters["tests"] / found[base].counters["tests"] for k, s in specs.items()}
            times = {k: found[s].share(found[base]) for k, s in specs.items()}
            yield Outcome(
                configuration,
                verdict(*(share.below(0.8) for share in times.values()), holds=max(tests.values()) <= 0.6),
                f"{name}: of the tests and of the time of {base}: "
                + "; ".join(f"{k} {tests[k]:.2f} and {times[k].value:.2f}" for k in specs)
                + " (limits: 0.6 and 0.8)",
                counters(lab, workload, configuration, CHOSEN) + EIGHT[configuration],
                lab.error(workload, [base, *specs.values()]),
                {f"tests {k}": v for k, v in tests.items()} | {f"time {k}": v.value for k, v in times.items()},
            )


def three_are_axes(lab: Lab) -> Iterator[Outcome]:
    """Whether the tree with only the axes equals the kd-tree; its remaining difference in time is noise."""
    yield from nowhere(lab)
    tree = ("bsp-wn-plus-kd", 3)
    for name, workload in scenes(lab):
        for configuration, base in BASES.items():
            own = spec(configuration, tree)
            (share,) = shares_of(lab, workload, configuration, [tree])
            nodes = [_nodes(lab, workload, one) for one in (base, own)]
            yield Outcome(
                configuration,
                verdict(holds=nodes[0] == nodes[1] and share.low <= 1 + NOISE and share.high >= 1 - NOISE),
                f"{name}: {label(tree)} has {nodes[1]}, {base} {nodes[0]}; {share.value:.2f} of its time",
                counters(lab, workload, configuration, [tree]),
                lab.error(workload, [base, own]),
                {"ratio": share.value},
            )


def _nodes(lab: Lab, workload: Workload, one: str) -> str:
    made = lab.statistics(workload, one)
    inner = made["nodes_axis"] + made["nodes_oblique"]
    return f"{inner:,} inner nodes, {made['leaves']:,} leaves and {made['references']:,} triangles in them"


def without_axes(lab: Lab) -> Iterator[Outcome]:
    """Trees with only the drawn directions, without the axes."""
    yield from nowhere(lab)
    for name, workload in scenes(lab):
        for configuration, base in BASES.items():
            shares = dict(zip(map(label, PLAIN), shares_of(lab, workload, configuration, PLAIN), strict=True))
            two = shares.pop(label(PLAIN[-1]))
            best = min(shares.values(), key=lambda share: share.value)
            # Faster than the kd-tree on the leg, slower elsewhere; two directions slow on Sponza as published.
            parts = [best.below()] if name == "leg" else [best.above(), two.above()]
            parts += [two.above(SLOW_RANDOM)] if name == "sponza" else []
            yield Outcome(
                configuration,
                verdict(*parts),
                f"{name}: of the time of {base}: "
                + ", ".join(f"{k} {share.value:.2f}" for k, share in shares.items())
                + f"; {label(PLAIN[-1])} {two.value:.2f}"
                + (f" (published: {SLOW_RANDOM})" if name == "sponza" else ""),
                counters(lab, workload, configuration, PLAIN),
                lab.error(workload, [base, *(spec(configuration, tree) for tree in PLAIN)]),
                {label(tree): share.value for tree, share in zip(PLAIN, (*shares.values(), two), strict=True)},
            )


def one_normal(lab: Lab) -> Iterator[Outcome]:
    """Time against the number of directions."""
    yield from nowhere(lab)
    trees = [("bsp-wn-plus-kd", k) for k in GAIN_K]
    for name, workload in scenes(lab):
        for configuration, base in BASES.items():
            shares = [share.value for share in shares_of(lab, workload, configuration, trees)]
            # Relate the gain of one normal to the gain of the best k.
            whole, first = shares[0] - min(shares), shares[0] - shares[1]
            part = first / whole if whole > 0 else 0.0
            yield Outcome(
                configuration,
                verdict(holds=whole > NOISE and part >= 0.5),
                f"{name}: of the time of {base}: "
                + ", ".join(f"K={k} {share:.2f}" for k, share in zip(GAIN_K, shares, strict=True))
                + (f"; one normal gives {part * 100:.0f} % of the gain" if whole > NOISE else "; there is no gain"),
                counters(lab, workload, configuration, trees[:2]),
                lab.error(workload, [base, *(spec(configuration, tree) for tree in trees)]),
                {f"K={k}": share for k, share in zip(GAIN_K, shares, strict=True)},
                (
                    Chart(
                        f"{configuration}, {name}: time by directions",
                        "K",
                        "of the kd-tree's time",
                        {"bsp-wn-plus-kd": list(zip(GAIN_K, shares, strict=True))},
                        level=(1.0, base),
                    ),
                ),
            )


def long_builds(lab: Lab) -> Iterator[Outcome]:
    """Build times of the trees as multiples of the kd-tree's."""
    yield from nowhere(lab)
    trees = [*CHOSEN, ("bsp-ize-kd", 0)]
    for name, workload in scenes(lab):
        for configuration, base in BASES.items():
            specs = [base, *(spec(configuration, tree) for tree in trees)]
            made = lab.build_seconds(workload, specs)
            seconds = made.seconds
            times = {label(tree): made.share(spec(configuration, tree), base) for tree in trees}
            swept, ize = (times[label(trees[0])], times[label(trees[2])])
            measured(lab, workload, specs)
            yield Outcome(
                configuration,
                verdict(swept.above(BUILDS), ize.above(IZE_BUILDS)),
                f"{name}: times the build of {base}, {seconds[base]:.2f} s ({made.method}): "
                + ", ".join(f"{k} {v.value:.1f}" for k, v in times.items())
                + " (published: 86 to 117, after Ize 196 to 353)",
                "the area of a cut cell comes from sums kept along the sweep, not from cutting the cell anew for every "
                "candidate, and end points stay sorted from parent to child",
                lab.error(workload, specs),
                {k: v.value for k, v in times.items()},
            )


def fixed_directions(lab: Lab) -> Iterator[Outcome]:
    """The same thirteen directions at every node, without cheap steps along the axes."""
    yield from nowhere(lab)
    tree = ("rbsp", 13)
    for name, workload in scenes(lab):
        for configuration, base in BASES.items():
            own = spec(configuration, tree)
            found = measured(lab, workload, [base, own])
            # Compare tests, steps and time with the kd-tree's.
            parts = {key: found[own].counters[key] / found[base].counters[key] for key in ("tests", "steps")}
            time = found[own].share(found[base])
            yield Outcome(
                configuration,
                verdict(time.above(), holds=parts["tests"] < 1 and parts["steps"] < 1),
                f"{name}: {parts['tests']:.2f} of the tests of {base}, {parts['steps']:.2f} of its nodes, "
                f"{time.value:.2f} of its time",
                counters(lab, workload, configuration, [tree]),
                lab.error(workload, [base, own]),
                parts | {"time": time.value},
            )


CLAIMS = (
    Claim(
        "sweep-trees-time",
        PAPER,
        "Time relative to a kd-tree's on the leg, Sponza and Conference: wn+^Kd 68, 80 and 79 %, cn+^Kd 68, 80 and "
        "79 % (K=6), random+^Kd 80, 86 and 87 % (K=10).",
        lambda lab: published_times(lab, TIMES, museum=True),
        MODELS,
    ),
    Claim(
        "other-trees-time",
        PAPER,
        "Time relative to a kd-tree's: IZE^Kd 95, 109 and 93 %, RBSP^Kd 84, 94 and 93 %.",
        lambda lab: published_times(lab, OTHERS, museum=False),
        MODELS,
    ),
    Claim(
        "sweep-trees-tests",
        PAPER,
        "wn+^Kd and cn+^Kd save 40 % of the intersections and 20 % of the time in all scenes.",
        tests_and_time,
        MODELS,
    ),
    Claim(
        "three-directions-are-kd",
        PAPER,
        "With K=3, the axes, and cheap axis nodes the tree is the kd-tree.",
        three_are_axes,
        MODELS,
    ),
    Claim(
        "without-axes",
        PAPER,
        "Without axes only the leg is faster than with a kd-tree; two random directions take 4.4 times its time on "
        "Sponza.",
        without_axes,
        MODELS,
    ),
    Claim("one-normal", PAPER, "One normal in addition to the axes gives most of the gain.", one_normal, MODELS),
    Claim(
        "long-builds",
        PAPER,
        "The trees take about a hundred times as long to build as a kd-tree, those of Ize 200 to 900 times.",
        long_builds,
        MODELS,
    ),
    Claim(
        "fixed-directions",
        PAPER,
        "RBSP takes fewer intersections and steps than a kd-tree, but is slower.",
        fixed_directions,
        MODELS,
    ),
)
