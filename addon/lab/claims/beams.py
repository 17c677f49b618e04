# SPDX-License-Identifier: GPL-3.0-or-later
"""González López and Gisbert Cantó: beams of rays through octrees, against single rays and box hierarchies.

The paper reports its results in four figures without numbers; its text states which line lies below which, and that the
line of the beams is much flatter. *faithful* has its beams, polygons that begin with the whole image; *best* has tiles
of 64 rays.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

from ...core.scene.workload import Workload
from ...core.structures.specs import joined, structure_of
from . import paper_scenes, published
from .claims import FAILS, UNTESTED, Chart, Claim, Lab, Outcome, Share, Timing, slope, verdict

PAPER = "González López and Gisbert Cantó, Trazado de haces (octrees with beams)"

BEAM, NET, SAMET, GLASSNER = "octree-beam", "octree-net", "octree-samet", "octree-glassner"
OCTREES = (BEAM, NET, SAMET, GLASSNER)
BOX = "bbox-gs"
BOXES = {"faithful": joined(BOX, published.FORMS[BOX]), "best": BOX}
"""Hierarchies of boxes by insertion: of any number of children and one object a leaf as published, and ours."""

MODERN = "bvh-sah"

TEAPOT = "utah-teapot-plane"

CONFIGURATIONS = {"faithful": "leaf_size=2,leaves=scalar", "best": "leaf_size=8"}
"""Largest number of objects per leaf: two, tested one by one, as published, and eight, all tested at once, here."""

THRESHOLD = 16
"""Rays below which those of a polygon go on singly. The paper has such a number and does not give it."""

FLAT = 0.5
"""The paper's 'much smaller' as a number: at most half the slope."""

ABOVE = (2560, 2048)
"""Width and height of a picture of four times as many pixels as the paper's largest."""


def octree(name: str, configuration: str) -> str:
    """The configuration string of an octree in one of the two configurations."""
    if name == BEAM and configuration == "faithful":
        return joined(name, f"traversal=polygon,beam_min={THRESHOLD},leaf_size=2")
    return joined(name, CONFIGURATIONS[configuration])


def sweep(
    lab: Lab, workload: Workload, specs: Sequence[str], sizes: Sequence[tuple[int, int]] = ()
) -> dict[str, list[Timing]]:
    """Each structure's times, from the paper's smallest picture to its largest. sizes: pictures (default: all)."""
    found: dict[str, list[Timing]] = {spec: [] for spec in specs}
    for size in sizes or paper_scenes.RESOLUTIONS:
        make = partial(paper_scenes.camera_rays, workload, size)
        rays = lab.rays(workload, "{}x{}".format(*size), make)
        for spec, timing in lab.seconds(workload, specs, rays).items():
            found[spec].append(timing)
    return found


def chart(workload: Workload, times: dict[str, list[Timing]]) -> Chart:
    """Time against rays, as in the paper's figures."""
    return Chart(
        f"{workload.name}: camera rays, 320×200 to 1280×1024",
        "million rays",
        "milliseconds",
        {structure_of(spec): [(t.rays / 1e6, t.seconds * 1e3) for t in own] for spec, own in times.items()},
    )


def steepness(own: Sequence[Timing], other: Sequence[Timing]) -> Share:
    """The slope of time over rays relative to another's."""

    def ratio(*seconds: Sequence[float]) -> float:
        return slope(zip(rays, seconds[0], strict=True)) / slope(zip(rays, seconds[1], strict=True))

    rays = [timing.rays for timing in own]
    whole = ratio(*([timing.seconds for timing in times] for times in (own, other)))
    passes = min(len(timing.rounds) for timing in (*own, *other))
    rounds = [ratio(*([timing.rounds[i] for timing in times] for times in (own, other))) for i in range(passes)]
    return Share.of(whole, rounds)


def per_ray(times: dict[str, list[Timing]]) -> str:
    """Nanoseconds per ray at the largest picture, fastest first, as text."""
    last = {structure_of(spec): own[-1].nanoseconds for spec, own in times.items()}
    return ", ".join(f"{spec} {value:.0f}" for spec, value in sorted(last.items(), key=lambda item: item[1]))


def counters(times: dict[str, list[Timing]], specs: Sequence[str]) -> str:
    """Steps, leaves and tests per ray at the largest picture, as text."""
    parts = []
    for spec in specs:
        one = times[spec][-1].counters
        leaves = one["leaves"] + one["leaves_empty"]
        parts.append(f"{structure_of(spec)} {one['steps']:.2f} steps, {leaves:.2f} leaves, {one['tests']:.2f} tests")
    return "per ray: " + "; ".join(parts)


def flat_line(lab: Lab) -> Iterator[Outcome]:
    """Slope of time over rays for beams, relative to that of the octree with links."""
    for workload in (paper_scenes.scattered(), paper_scenes.concentrated()):
        for configuration in CONFIGURATIONS:
            specs = [octree(tree, configuration) for tree in OCTREES]
            times = sweep(lab, workload, specs)
            slopes = {spec: slope((t.rays, t.seconds) for t in own) for spec, own in times.items()}
            beam, net = slopes[specs[0]], slopes[specs[1]]
            yield Outcome(
                configuration,
                steepness(times[specs[0]], times[specs[1]]).below(FLAT),
                f"{workload.name} ({nodes(lab, workload, specs[1])} nodes): each additional ray costs beams "
                f"{beam * 1e9:.0f} ns, octree-net {net * 1e9:.0f} ns, {beam / net:.2f} times as much (limit: {FLAT})",
                counters(times, specs[:2]),
                lab.error(workload, specs),
                {"slope_beam_ns": beam * 1e9, "slope_net_ns": net * 1e9, "ratio": beam / net},
                (chart(workload, times),),
            )


def nodes(lab: Lab, workload: Workload, spec: str) -> int:
    """Number of nodes of an octree, leaves included."""
    statistics = lab.statistics(workload, spec)
    return int(statistics["nodes_axis"] + statistics["leaves"])


def fastest(lab: Lab) -> Iterator[Outcome]:
    """Whether beams are the fastest traversal of an octree at the largest picture and above, and faster than box
    hierarchies.
    """
    for workload in (paper_scenes.scattered(), paper_scenes.concentrated()):
        for configuration in CONFIGURATIONS:
            specs = [octree(tree, configuration) for tree in OCTREES]
            lacking = lab.lacks(BOX)
            specs += [] if lacking else [BOXES[configuration]]
            specs += [MODERN] if configuration == "best" else []
            times = sweep(lab, workload, specs)
            above = lab.seconds(workload, specs, paper_scenes.camera_rays(workload, ABOVE))
            last = {structure_of(spec): own[-1] for spec, own in times.items()}
            far = {structure_of(spec): [own] for spec, own in above.items()}
            octrees = verdict(
                *(last[BEAM].share(last[one]).below() for one in OCTREES[1:]),
                *(far[BEAM][0].share(far[one][0]).below() for one in OCTREES[1:]),
            )
            boxes = UNTESTED
            if not lacking:
                boxes = verdict(last[BEAM].share(last[BOX]).below(), far[BEAM][0].share(far[BOX][0]).below())
            yield Outcome(
                configuration,
                octrees if octrees == FAILS else boxes,
                f"{workload.name}: ns per ray at 1280×1024: {per_ray(times)}; at {ABOVE[0]}×{ABOVE[1]}: "
                f"{per_ray(far)}. Against the other octrees: {octrees}; against B.Box: {lacking or boxes}",
                counters(times, [spec for spec in specs if structure_of(spec) in (BEAM, NET, BOX)]),
                lab.error(workload, specs),
                {name: timing.nanoseconds for name, timing in last.items()}
                | {f"above, {name}": own[0].nanoseconds for name, own in far.items()},
                (chart(workload, times),),
            )


def against_boxes(lab: Lab, workload: Workload, methods: Sequence[str], *, octrees_win: bool) -> Iterator[Outcome]:
    """Whether single rays through octrees are faster than a box hierarchy at every resolution, or slower."""
    lacking = lab.lacks(BOX)
    for configuration in CONFIGURATIONS:
        if lacking:
            yield Outcome(configuration, UNTESTED, lacking)
            continue
        # Compare at every resolution, in the claimed direction.
        specs = [octree(tree, configuration) for tree in methods] + [BOXES[configuration]]
        times = sweep(lab, workload, specs)
        shares = {
            (spec, size): own.share(box) if octrees_win else box.share(own)
            for spec in specs[:-1]
            for size, own, box in zip(paper_scenes.RESOLUTIONS, times[spec], times[specs[-1]], strict=True)
        }
        (spec, size), worst = max(shares.items(), key=lambda item: item[1].low)
        pair = (spec, BOX) if octrees_win else (BOX, spec)
        yield Outcome(
            configuration,
            verdict(*(share.below() for share in shares.values())),
            f"{workload.name}: ns per ray at 1280×1024: {per_ray(times)}; least ahead at {size[0]}×{size[1]}, where "
            f"{structure_of(pair[0])} takes {worst.value:.2f} of the time of {structure_of(pair[1])}",
            counters(times, specs),
            lab.error(workload, specs),
            {structure_of(spec): own[-1].nanoseconds for spec, own in times.items()},
            (chart(workload, times),),
        )


def links_gain(lab: Lab) -> Iterator[Outcome]:
    """The cost of links at build time against the trace time they save, which grows with the number of rays."""
    workload = paper_scenes.scattered()
    for configuration in CONFIGURATIONS:
        specs = [octree(tree, configuration) for tree in (NET, SAMET)]
        times = sweep(lab, workload, specs)
        # Take the saved time as a function of the number of rays.
        saved = [(t.rays, s.seconds - t.seconds) for t, s in zip(times[specs[0]], times[specs[1]], strict=True)]
        made = lab.build_seconds(workload, specs)
        build = [made.seconds[spec] for spec in specs]
        size = [int(lab.statistics(workload, spec)["bytes"]) for spec in specs]
        gain = slope(saved)
        yield Outcome(
            configuration,
            verdict(times[specs[0]][-1].share(times[specs[1]][-1]).below(), holds=saved[-1][1] > saved[0][1]),
            f"links save {gain * 1e9:.1f} ns a ray, {saved[-1][1] * 1e3:.1f} ms at 1280×1024, and cost "
            f"{(build[0] - build[1]) * 1e6:.0f} µs of the build ({made.method}) and "
            f"{(size[0] / size[1] - 1) * 100:.0f} % more memory",
            counters(times, specs),
            lab.error(workload, specs),
            {"saved_ns": gain * 1e9, "bytes_net": size[0], "bytes_samet": size[1]},
            (chart(workload, times),),
        )


def neighbours(lab: Lab) -> Iterator[Outcome]:
    """Share of the time spent on finding neighbours: the time that stored links save is a lower bound."""
    for workload in (paper_scenes.scattered(), paper_scenes.concentrated()):
        for configuration in CONFIGURATIONS:
            specs = [octree(tree, configuration) for tree in (NET, SAMET, GLASSNER)]
            times = sweep(lab, workload, specs)
            net, samet, glassner = (times[spec][-1].seconds for spec in specs)
            shares = {"samet": 1 - net / samet, "glassner": 1 - net / glassner}
            yield Outcome(
                configuration,
                verdict(holds=0.3 <= max(shares.values()) <= 0.5),
                f"{workload.name}: with links {shares['samet'] * 100:.0f} % of the time by common ancestors is "
                f"saved, {shares['glassner'] * 100:.0f} % of that from the root (published: up to 40 %)",
                counters(times, specs),
                lab.error(workload, specs),
                shares,
            )


def teapot(lab: Lab) -> Iterator[Outcome]:
    """A small dense object in a large empty scene: single rays and beams through the octree, against boxes."""
    workload = lab.shared(TEAPOT)
    lacking = lab.lacks(BOX)
    for configuration in CONFIGURATIONS:
        if workload is None:
            yield Outcome(configuration, UNTESTED, f"the scene {TEAPOT} is missing")
            continue
        specs = [octree(tree, configuration) for tree in (BEAM, NET, SAMET)]
        specs += [] if lacking else [BOXES[configuration]]
        specs += [MODERN] if configuration == "best" else []
        times = sweep(lab, workload, specs)
        last = {structure_of(spec): own[-1] for spec, own in times.items()}
        statistics = lab.statistics(workload, specs[1])
        holds = UNTESTED
        if not lacking:
            holds = verdict(*(last[BOX].share(last[one]).below() for one in (NET, SAMET)))
        yield Outcome(
            configuration,
            holds,
            f"{workload.name} ({nodes(lab, workload, specs[1])} nodes, depth {statistics['depth_max']}): ns per ray at "
            f"1280×1024: {per_ray(times)}{'; ' + lacking if lacking else ''}",
            counters(times, specs[:2]),
            lab.error(workload, specs),
            {name: timing.nanoseconds for name, timing in last.items()},
            (chart(workload, times),),
        )


CLAIMS = (
    Claim(
        "beams-flat-line",
        PAPER,
        "From 320×200 to 1280×1024 the line of the time of beams rises much less than that of single rays.",
        flat_line,
    ),
    Claim("beams-fastest", PAPER, "At high resolution beams are the fastest of all methods, on both scenes.", fastest),
    Claim(
        "octrees-beat-boxes",
        PAPER,
        "First scene: every method on octrees is faster than a hierarchy of bounding volumes.",
        lambda lab: against_boxes(lab, paper_scenes.scattered(), (BEAM, NET, SAMET), octrees_win=True),
    ),
    Claim(
        "boxes-beat-octrees",
        PAPER,
        "Second scene: the hierarchy of bounding volumes is faster than both traversals of the octree by single rays.",
        lambda lab: against_boxes(lab, paper_scenes.concentrated(), (NET, SAMET), octrees_win=False),
    ),
    Claim("links-gain", PAPER, "Links gain on the search for the common ancestor as the resolution rises.", links_gain),
    Claim(
        "neighbour-search",
        PAPER,
        "Looking for neighbours takes up to 40 % of the time (quoted from McNeill et al. 1992).",
        neighbours,
    ),
    Claim(
        "teapot-in-the-stadium",
        PAPER,
        "A small object in a large scene (a teapot in a football ground) makes the octree deep; boxes beat single rays "
        "there too.",
        teapot,
        (TEAPOT,),
    ),
)
