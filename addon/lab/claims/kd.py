# SPDX-License-Identifier: GPL-3.0-or-later
"""Havran, Kopal, Bittner and Žára: a kd-tree traversal by the coordinates of entry and exit, against two by distances.

Traversals are timed alone, without triangle tests, as the paper compares them, and also as whole queries. The faithful
configuration tests one triangle at a time, as published and without error bounds, so some of its answers are wrong.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

from ...core.measure.accuracy import Errors, total
from ...core.scene import rays
from ...core.scene.workload import Workload
from ..stability import stability
from . import cases, paper_scenes
from .cases import CASES
from .claims import UNTESTED, Chart, Checked, Claim, Lab, Outcome, Share, Timing, verdict

PAPER = "Havran, Kopal, Bittner and Žára, Fast robust BSP tree traversal algorithm for ray tracing (1997)"

WALKS = ("ta-b", "ta-a", "sung", "arvo")
"""The paper's traversal, then those that it is compared with."""

AGAINST = ("sung", "arvo")
SAVED = 0.7
"""The paper's 'saves 30 to 50 %' as a number: at most this share of the others' time."""

TREES = {"faithful": "kd-sah:robust=none,leaves=scalar,traversal=", "best": "kd:traversal="}
"""Unclipped triangles in leaves and traversals as published; clipped triangles and traversals with error bounds."""

LITTLE, PICTURE = 0.1, 3 << 20
"""Share of the time of a picture that a build may take as 'relatively little time' (chosen), and the rays of a picture:
a million pixels, a bounce and a shadow ray each.
"""

SIZE = (384, 384)
"""Width and height of the view in pixels."""

SETS = ("primary", "diffuse", "shadow")
SINGULAR = ("touching boxes", "signs of zero", "coplanar", "corners of boxes", "octants", "view on the lattice")
"""Extreme test cases whose rays lie in planes of the scene."""

SCENES = ("sponza-dabrovic", "conference", "killeroo-feet")


def scenes(lab: Lab) -> Iterator[Workload]:
    """The shared scenes that exist, and one that always does."""
    yield paper_scenes.scattered()
    yield from (workload for name in SCENES if (workload := lab.shared(name)) is not None)


def ray_sets(lab: Lab, workload: Workload) -> list[rays.RaySet]:
    """The rays of the view, their bounces and their shadow rays; empty sets are dropped."""
    made: list[rays.RaySet] = []

    def all_sets() -> list[rays.RaySet]:
        if not made:
            made.extend(rays.make(workload, lab.build(workload, "kd"), size=SIZE, seed=1, names=SETS))
        return made

    def one(name: str) -> rays.RaySet:
        own = next(some for some in all_sets() if some.name == name)
        return replace(own, name=f"{name} of {SIZE[0]}x{SIZE[1]}")

    found = [lab.rays(workload, f"{name} of {SIZE[0]}x{SIZE[1]}", partial(one, name)) for name in SETS]
    return [some for some in found if len(some)]


def times(lab: Lab, workload: Workload, specs: Sequence[str], *, alone: bool) -> dict[str, Timing]:
    """Each traversal's time over all ray sets, alone or with triangle tests, and its mean counters."""
    found: dict[str, list[Timing]] = {spec: [] for spec in specs}
    for some in ray_sets(lab, workload):
        measured = (lab.walks if alone else lab.seconds)(workload, specs, some)
        for spec in specs:
            found[spec].append(measured[spec])
    return {spec: _together(parts) for spec, parts in found.items()}


def counts(lab: Lab, workload: Workload, specs: Sequence[str]) -> dict[str, Mapping[str, float]]:
    """Each configuration's mean counters over all ray sets."""
    sets = ray_sets(lab, workload)
    return {spec: _together([lab.counts(workload, spec, some) for some in sets]).counters for spec in specs}


def _together(parts: Sequence[Timing]) -> Timing:
    count = sum(part.rays for part in parts)
    counters = {name: sum(part.rays * part.counters[name] for part in parts) / count for name in parts[0].counters}
    rounds = tuple(map(sum, zip(*(part.rounds for part in parts), strict=False)))
    return Timing(count, sum(part.seconds for part in parts), counters, rounds)


def saves(lab: Lab, *, alone: bool, most: float) -> Iterator[Outcome]:
    """The time of TA-B as a share of each other traversal's, scene by scene."""
    lines: dict[str, dict[str, list[tuple[float, float]]]] = {name: {walk: [] for walk in WALKS} for name in TREES}
    chosen = list(scenes(lab))
    for workload in chosen:
        if not ray_sets(lab, workload):
            yield Outcome("best", UNTESTED, f"{workload.name}: no ray hits the scene")
            continue
        # Time all traversals of one tree; the last scene's outcome carries the chart of all scenes.
        for configuration, tree in TREES.items():
            specs = {walk: tree + walk for walk in WALKS}
            measured = times(lab, workload, list(specs.values()), alone=alone)
            own = measured[specs["ta-b"]]
            for walk, spec in specs.items():
                lines[configuration][walk].append((len(lines[configuration][walk]), measured[spec].nanoseconds))
            shares = {walk: own.share(measured[specs[walk]]) for walk in WALKS[1:]}
            told = ", ".join(f"{share.value:.2f} of {walk}" for walk, share in shares.items())
            nanoseconds = ", ".join(f"{walk} {measured[spec].nanoseconds:.0f}" for walk, spec in specs.items())
            yield Outcome(
                configuration,
                verdict(*(shares[walk].below(most) for walk in AGAINST)),
                f"{workload.name}: TA-B takes {told} (limit: {most:g}); ns a ray: {nanoseconds}",
                why(own.counters, {walk: measured[spec].counters for walk, spec in specs.items()}),
                lab.error(workload, list(specs.values())),
                {walk: share.value for walk, share in shares.items()},
                (chart(configuration, chosen, lines[configuration]),) if workload is chosen[-1] else (),
            )


def why(own: Mapping[str, float], all_walks: Mapping[str, Mapping[str, float]]) -> str:
    """Steps per ray by traversal, and the share of TA-B's steps with both children, the only ones that compute a
    distance.
    """
    steps = ", ".join(f"{walk} {counters['steps']:.1f}" for walk, counters in all_walks.items())
    both = own["case_n4"] + own["case_p4"]
    whole = max(sum(own[name] for name in CASES), 1e-9)
    histogram = ", ".join(f"{name[5:].upper()} {own[name] / whole * 100:.1f}" for name in CASES if own[name] > 0)
    return (
        f"inner nodes a ray: {steps}; leaves {own['leaves'] + own['leaves_empty']:.1f}, tests {own['tests']:.1f}. "
        f"{both / whole * 100:.0f} % of TA-B's nodes lead to both children, where it computes a distance and two "
        f"coordinates; the others are two comparisons. Sung and Arvo compute one distance, by one product, at every "
        f"node. Cases in %: {histogram}"
    )


def chart(configuration: str, chosen: Sequence[Workload], lines: Mapping[str, list[tuple[float, float]]]) -> Chart:
    """Bars of nanoseconds per ray, scene by scene, one colour per traversal."""
    named = ", ".join(f"{place} {workload.name}" for place, workload in enumerate(chosen))
    return Chart(f"{configuration}: {named}", "scene", "ns a ray", lines, bars=True)


def singular(lab: Lab) -> Iterator[Outcome]:
    """Rays in walls, along edges and through corners: number of wrong answers of each traversal."""
    for configuration, tree in TREES.items():
        # Leaves with the exact verdict: hits that f32 rounds are no fault of the traversal.
        exact = tree.replace("leaves=scalar,", "")
        found = singular_errors(lab, [exact + traversal for traversal in WALKS])
        wrong = {spec.removeprefix(exact): errors.wrong for spec, errors in found.items()}
        yield Outcome(
            configuration,
            verdict(holds=wrong["ta-b"] == 0),
            f"of {next(iter(found.values())).rays:,} rays in walls, along edges and through corners, wrong: "
            + ", ".join(f"{walk} {number:,}" for walk, number in wrong.items()),
            "its cases are distinguished without rounding, but the crossing points that it compares are rounded: a ray "
            "that leaves a cell through an edge enters the wrong neighbour unless the comparison has an error bound",
            Checked.of(found, found.values()),
            {walk: float(number) for walk, number in wrong.items()},
        )


def singular_errors(lab: Lab, specs: Sequence[str]) -> dict[str, Errors]:
    """The errors of each structure on the singular rays, all cases together."""
    found: dict[str, list[Errors]] = {spec: [] for spec in specs}
    for case in (one for one in lab.native.cases() if one["name"] in SINGULAR):
        for spec, errors, *_ in stability.case_errors(lab.native, case, specs, exact_pairs=0):
            found[spec].append(errors)
            lab.compared(case["name"], spec, "singular", errors)
    return {spec: total(parts) for spec, parts in found.items()}


def comparisons(lab: Lab) -> Iterator[Outcome]:
    """The operations of TA-B at an inner node, by its counters: its cases cover all nodes, and few of them compute."""
    found: dict[str, dict[str, dict[str, float]]] = {name: {} for name in TREES}
    chosen = list(scenes(lab))
    for workload in chosen:
        if not ray_sets(lab, workload):
            yield Outcome("best", UNTESTED, f"{workload.name}: no ray hits the scene")
            continue
        for configuration, tree in TREES.items():
            spec = f"{tree}ta-b"
            own = times(lab, workload, [spec], alone=True)[spec].counters
            # Weight the operations of each case by its share; the last scene's outcome carries the histograms of all.
            shares = cases.histogram(own)
            both, whole = sum(own[name] for name in cases.BOTH), sum(own[name] for name in CASES)
            found[configuration][workload.name] = shares
            operations = cases.means(own)
            counts = "; ".join(
                f"{name} {mean.comparisons:.2f} comparisons and {mean.arithmetic:.2f} additions, products and divisions"
                for name, mean in operations.items()
            )
            yield Outcome(
                configuration,
                verdict(holds=abs(whole / max(own["steps"], 1e-9) - 1) < 1e-6 and both < whole),
                f"{workload.name}: {own['steps']:.1f} inner nodes a ray, each of one of the {len(CASES)} cases; "
                f"{both / max(whole, 1e-9) * 100:.0f} % of them lead to both children and compute a distance, the "
                f"others two comparisons and nothing else. Mean operations at a node, as published: {counts}",
                why(own, {"ta-b": own}),
                lab.error(workload, [spec]),
                {"computing": both / max(whole, 1e-9)}
                | {name.removeprefix("case_"): share for name, share in shares.items()}
                | {f"{name}_comparisons": mean.comparisons for name, mean in operations.items()}
                | {f"{name}_arithmetic": mean.arithmetic for name, mean in operations.items()},
                (cases.chart(configuration, found[configuration]),) if workload is chosen[-1] else (),
            )


def construction(lab: Lab) -> Iterator[Outcome]:
    """The time of a build as a share of that of the rays of one picture."""
    for workload in scenes(lab):
        for configuration, tree in TREES.items():
            spec = f"{tree}ta-b"
            if not ray_sets(lab, workload):
                continue
            made, found = lab.build_seconds(workload, [spec]), times(lab, workload, [spec], alone=False)[spec]
            share = Share.of(made.seconds[spec] * 1e9 / (found.nanoseconds * PICTURE))
            yield Outcome(
                configuration,
                share.below(LITTLE),
                f"{workload.name}, {len(workload.triangles):,} triangles: {spec} is built in "
                f"{made.seconds[spec] * 1e3:.0f} ms ({made.method}), {share.value:.2f} of the time of {PICTURE:,} rays "
                f"of {found.nanoseconds:.0f} ns (limit: {LITTLE:g})",
                f"{lab.statistics(workload, spec)['references'] / max(len(workload.triangles), 1):.1f} references per "
                "triangle",
                lab.error(workload, [spec]),
                {"share": share.value},
            )


def reuse(lab: Lab) -> Iterator[Outcome]:
    """The number of crossing points that TA-B computes, and of comparisons that use one, by its counters."""
    for workload in scenes(lab):
        if not ray_sets(lab, workload):
            continue
        for configuration, tree in TREES.items():
            spec = f"{tree}ta-b"
            own = times(lab, workload, [spec], alone=True)[spec].counters
            points, compared = sum(own[name] for name in cases.BOTH), 2 * own["steps"]
            yield Outcome(
                configuration,
                verdict(holds=points < own["steps"]),
                f"{workload.name}: a ray computes {points:.1f} crossing points and compares coordinates of entry and "
                f"exit {compared:.1f} times: {compared / max(points, 1e-9):.1f} comparisons a point",
                "a crossing point is the exit of the nearer child and the entry of the farther one; both keep it for "
                "all nodes below",
                lab.error(workload, [spec]),
                {"points": points, "comparisons": compared},
            )


CLAIMS = (
    Claim(
        "ta-b-construction",
        PAPER,
        "The tree is built in relatively little time.",
        construction,
        SCENES,
    ),
    Claim(
        "ta-b-reuse",
        PAPER,
        "The crossing point is the costly part; it is reused further down and not computed again.",
        reuse,
        SCENES,
    ),
    Claim(
        "ta-b-comparisons",
        PAPER,
        "Two comparisons at an inner node; the distance of its plane only when both children are visited.",
        comparisons,
        SCENES,
    ),
    Claim(
        "ta-b-walks",
        PAPER,
        "TA-B saves 30 to 50 % of the time of traversal against the algorithms of Sung and of Arvo.",
        lambda lab: saves(lab, alone=True, most=SAVED),
        SCENES,
    ),
    Claim(
        "ta-b-rays",
        PAPER,
        "Ray tracing with TA-B is about twice as fast.",
        lambda lab: saves(lab, alone=False, most=0.5),
        SCENES,
    ),
    Claim("ta-b-singularities", PAPER, "TA-B handles all singularities correctly.", singular),
)
