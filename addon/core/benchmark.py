# SPDX-License-Identifier: GPL-3.0-or-later
"""Measuring structures on a scene: first the proof that the answers are right, then the time.

Repeats are interleaved over all structures, so that a machine that slows down hurts all alike. A structure too slow for
the whole of a ray set is timed on a part of it, and the row tells how many rays that were.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import accuracy, curve, rays, specs, yardstick
from .accuracy import Answers, Errors
from .rays import RaySet
from .workload import Workload

BUILDS = 3
"""A build is timed this often at most; it varies less than tracing, and takes longer."""

PASS_SECONDS = 5.0
"""One timed pass over a ray set takes about this long at most; slower structures get fewer rays."""

ORACLE_SECONDS = 0.5
"""The same for the reference itself, whose speed interests nobody to three digits."""

LIVE_BYTES = 4 << 30
"""Structures that are measured interleaved share this much memory at most."""

SELF_CHECK = 2048
"""Rays per set on which the reference is compared with itself."""

REFERENCES = ("brute", "exact", "embree")


@dataclass(frozen=True)
class Options:
    """What is measured. size: width and height of the view; check_rays: rays per set compared with the reference.

    threads: for builds and tracing. seed: of the rays. memory_limit: bytes that a build may take, None for what the
    native module allows; a configuration that needs more gives a row whose `error` says so.
    """

    size: tuple[int, int] = (1024, 1024)
    sets: tuple[str, ...] = rays.NAMES
    repeats: int = 7
    threads: int = 1
    reference: str = "brute"
    check_rays: int = 20_000
    seed: int = 1
    curve: tuple[int, ...] = ()
    memory_limit: int | None = None

    def as_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(self).items()}


Row = dict[str, Any]


@dataclass(eq=False)
class _Candidate:
    """A configuration while it is measured."""

    spec: str
    structure: Any
    build_seconds: list[float]
    errors: dict[str, Errors]
    timed: dict[str, RaySet]
    counted: dict[str, dict[str, float]]
    seconds: dict[str, list[float]]
    curve: list[dict[str, float]] = field(default_factory=list)
    differing_pixels: int = 0


def measure(
    native: Any, workload: Workload, chosen: Sequence[str], options: Options, say: Callable[[str], None]
) -> Iterator[Row]:
    """One row per configuration, as soon as it is complete.

    chosen: valid configurations; `embree` names the yardstick. A configuration that cannot be built gives a row whose
    `error` says why. say: told what is being done.
    """
    tracer = native.build(workload.vertices, workload.triangles, _tracer_spec(native), threads=0)
    ray_sets = rays.make(workload, tracer, size=options.size, seed=options.seed, names=options.sets)
    del tracer
    checked = {}
    for rays_of_set in ray_sets:
        own = rays_of_set in workload.extra
        wanted = len(rays_of_set) if own else options.check_rays
        checked[rays_of_set.name] = rays_of_set.take(rays.blocks(len(rays_of_set), wanted, options.seed))
    count = sum(map(len, checked.values()))
    say(f"{workload.name}: {count:,} rays by {options.reference}, the reference")
    expected = _reference(native, workload, checked, options)
    pictures = None
    if options.curve:
        pictures = curve.Curve(native, workload, options.size, options.curve, options.seed)
        say(f"{workload.name}: rendering the converged picture")
        pictures.converge(native.build(workload.vertices, workload.triangles, _tracer_spec(native), threads=0))
    for group in _groups(native, workload, chosen, options, say):
        candidates: list[_Candidate] = []
        for item in group:
            if isinstance(item, _Candidate):
                candidates.append(item)
            else:
                yield item
        for candidate in candidates:
            say(f"{workload.name}: {candidate.spec}: checking {count:,} rays")
            _prove(native, candidate, ray_sets, checked, expected, options)
        say(f"{workload.name}: timing {', '.join(c.spec for c in candidates)}")
        _time(candidates, ray_sets, options)
        if pictures is not None:
            say(f"{workload.name}: rendering with {', '.join(map(str, options.curve))} samples per pixel")
            _draw(candidates, pictures, options)
        base = next((c for c in candidates if c.spec == yardstick.SPEC), None)
        for candidate in candidates:
            yield _row(native, workload, candidate, ray_sets, base, options)


def agrees(row: Row) -> bool:
    """Whether a row's answers are those of its reference. Brute force must be met to the last bit."""
    errors = row["errors"]
    if errors is None:
        return False
    wrong = ("false_miss", "false_hit", "wrong_triangle", "wrong_any_hit", "differing_pixels")
    bits = ("wrong_values", "t_ulp_max") if errors["reference"] == "brute" else ()
    return not any(errors[key] for key in wrong + bits)


def _tracer_spec(native: Any) -> str:
    ids = [row["id"] for row in native.structures()]
    return "kd" if "kd" in ids else "brute"


def _reference(native: Any, workload: Workload, checked: dict[str, RaySet], options: Options) -> dict[str, Answers]:
    """What the reference answers to the checked rays of each set, on all cores."""
    vertices, triangles = workload.vertices, workload.triangles
    found = {}
    structure: Any = None
    if options.reference == "brute":
        structure = native.build(vertices, triangles, "brute", threads=0)
    elif options.reference == "embree":
        structure = yardstick.EmbreeStructure(vertices, triangles)
    for name, some in checked.items():
        if structure is None:
            hits = native.exact_closest(vertices, triangles, some.origins, some.directions, t_max=some.t_max)
        else:
            hits = structure.closest(some.origins, some.directions, t_max=some.t_max, threads=0)
        found[name] = Answers.of(hits)
    return found


def _build(native: Any, workload: Workload, spec: str, options: Options) -> Any:
    if spec == yardstick.SPEC:
        return yardstick.EmbreeStructure(workload.vertices, workload.triangles)
    return native.build(
        workload.vertices, workload.triangles, spec, threads=options.threads, memory_limit=options.memory_limit
    )


def _groups(
    native: Any, workload: Workload, chosen: Sequence[str], options: Options, say: Callable[[str], None]
) -> Iterator[list[_Candidate | Row]]:
    """Built configurations in groups that fit into memory together; the yardstick is in each group."""
    group: list[_Candidate | Row] = []
    size = 0
    with_yardstick = yardstick.SPEC in chosen
    rest = [spec for spec in chosen if spec != yardstick.SPEC]
    for number, spec in enumerate(rest):
        say(f"{workload.name}: {spec}: building")
        try:
            candidate = _Candidate(spec, _build(native, workload, spec, options), [], {}, {}, {}, {})
        except (ValueError, RuntimeError, MemoryError) as error:
            group.append(_failed_row(native, workload, spec, options, error))
            continue
        group.append(candidate)
        size += candidate.structure.statistics["bytes"]
        if size > LIVE_BYTES and number + 1 < len(rest):
            yield _with_builds(native, workload, group, options, with_yardstick)
            group, size = [], 0
    yield _with_builds(native, workload, group, options, with_yardstick)


def _with_builds(
    native: Any, workload: Workload, group: list[_Candidate | Row], options: Options, with_yardstick: bool
) -> list[_Candidate | Row]:
    """The group with its yardstick, every build timed again, interleaved."""
    if with_yardstick:
        structure = _build(native, workload, yardstick.SPEC, options)
        group = [_Candidate(yardstick.SPEC, structure, [], {}, {}, {}, {}), *group]
    candidates = [item for item in group if isinstance(item, _Candidate)]
    for candidate in candidates:
        candidate.build_seconds.append(candidate.structure.statistics["build_seconds"])
    for _ in range(min(options.repeats, BUILDS) - 1):
        for candidate in candidates:
            again = _build(native, workload, candidate.spec, options)
            candidate.build_seconds.append(again.statistics["build_seconds"])
    return group


def _prove(
    native: Any,
    candidate: _Candidate,
    ray_sets: Iterable[RaySet],
    checked: dict[str, RaySet],
    expected: dict[str, Answers],
    options: Options,
) -> None:
    """Compare closest and any hits with the reference, count steps, and choose how many rays can be timed."""
    structure = candidate.structure
    for whole in ray_sets:
        some, right = checked[whole.name], expected[whole.name]
        if candidate.spec == options.reference:
            # It is compared with itself: enough to see that the numbers of threads agree.
            own = rays.blocks(len(some), SELF_CHECK, options.seed)
            some, right = some.take(own), right.take(own)
        arguments: dict[str, Any] = {"t_max": some.t_max, "order": some.order, "threads": options.threads}
        start = time.perf_counter()
        answers = Answers.of(structure.closest(some.origins, some.directions, **arguments))
        seconds = time.perf_counter() - start
        occluded = structure.occluded(some.origins, some.directions, **arguments)
        candidate.errors[whole.name] = accuracy.compare(
            right, answers, occluded, native.ulp_distance, bitwise=options.reference == "brute"
        )
        limit = ORACLE_SECONDS if candidate.spec == options.reference else PASS_SECONDS
        affordable = int(len(some) * limit / max(seconds, 1e-9))
        candidate.timed[whole.name] = whole.take(rays.blocks(len(whole), affordable, options.seed))
        hits = float(answers.hit.mean()) if len(some) else 0.0
        candidate.counted[whole.name] = {"hits": hits, **_count(candidate, some, arguments)}


def _count(candidate: _Candidate, some: RaySet, arguments: dict[str, Any]) -> dict[str, float]:
    """Mean steps and triangle tests per ray."""
    if candidate.spec == yardstick.SPEC or not len(some):
        return {}
    if some.any_hit:
        _, counters = candidate.structure.occluded(some.origins, some.directions, counters=True, **arguments)
    else:
        found = candidate.structure.closest(some.origins, some.directions, counters=True, **arguments)
        counters = found.counters
    return {name: float(np.mean(counters[name])) for name in ("steps", "tests")}


def _time(candidates: Sequence[_Candidate], ray_sets: Iterable[RaySet], options: Options) -> None:
    """Time every configuration on every set. The first pass over each set only warms up."""
    # On one thread the processor's own clock counts what the work costs, however busy the machine is.
    clock = time.process_time if options.threads == 1 else time.perf_counter
    for whole in ray_sets:
        for repeat in range(options.repeats + 1):
            for candidate in candidates:
                some = candidate.timed[whole.name]
                arguments: dict[str, Any] = {"t_max": some.t_max, "order": some.order, "threads": options.threads}
                ask = candidate.structure.occluded if some.any_hit else candidate.structure.closest
                if candidate.spec == yardstick.SPEC and not some.any_hit:
                    ask, arguments = candidate.structure.closest_ids, {"t_max": some.t_max}
                start = clock()
                ask(some.origins, some.directions, **arguments)
                seconds = clock() - start
                if repeat:
                    candidate.seconds.setdefault(whole.name, []).append(seconds)


def _draw(candidates: Sequence[_Candidate], pictures: curve.Curve, options: Options) -> None:
    """Render pictures with growing numbers of samples, interleaved over the configurations."""
    ours = [candidate for candidate in candidates if candidate.spec != yardstick.SPEC]
    for samples in options.curve:
        for candidate in ours:
            slowest = min((min(_mrays(candidate, name)) for name in candidate.seconds), default=1.0)
            if samples in pictures.affordable(slowest):
                point, differing = pictures.point(candidate.structure, samples, options.threads)
                candidate.curve.append(point)
                candidate.differing_pixels += differing


def spread(numbers: Sequence[float] | NDArray[np.float64]) -> dict[str, float]:
    """Smallest, median and largest."""
    return {"min": float(min(numbers)), "med": float(np.median(numbers)), "max": float(max(numbers))}


def _row(
    native: Any,
    workload: Workload,
    candidate: _Candidate,
    ray_sets: Iterable[RaySet],
    base: _Candidate | None,
    options: Options,
) -> Row:
    statistics = dict(candidate.structure.statistics)
    row = _empty_row(native, workload, candidate.spec, options)
    row["build_s"] = spread(candidate.build_seconds)
    row["bytes"] = statistics.get("bytes")
    row["left_out"] = list(statistics.pop("left_out", []))
    row["statistics"] = statistics
    row["rays"] = {rays_of_set.name: _rates(candidate, rays_of_set, base) for rays_of_set in ray_sets}
    row["errors"] = accuracy.total(candidate.errors.values()).as_row(options.reference)
    row["errors"]["sets"] = {name: errors.as_row(options.reference) for name, errors in candidate.errors.items()}
    # Pixels in which a picture is not that of the first structure; 0 where nothing was rendered.
    row["errors"]["differing_pixels"] = candidate.differing_pixels
    if candidate.curve:
        row["curve"] = candidate.curve
        row["render_s"] = candidate.curve[-1]["seconds"]
    left = [n for n in options.curve if n not in {point["spp"] for point in candidate.curve}]
    if left and candidate.spec != yardstick.SPEC:
        row["left_out"].append(f"pictures with {', '.join(map(str, left))} samples per pixel: they would take too long")
    return row


def _rates(candidate: _Candidate, whole: RaySet, base: _Candidate | None) -> dict[str, Any]:
    some = candidate.timed[whole.name]
    counted = candidate.counted[whole.name]
    found: dict[str, Any] = {
        "n": len(some),
        "mrays_s": None,
        "times_embree": None,
        "steps": counted.get("steps"),
        "tests": counted.get("tests"),
        "hits": counted["hits"],
    }
    if len(some):
        rates = _mrays(candidate, whole.name)
        found["mrays_s"] = spread(rates)
        if base is not None:
            found["times_embree"] = float(np.median(rates) / np.median(_mrays(base, whole.name)))
    return found


def _mrays(candidate: _Candidate, name: str) -> NDArray[np.float64]:
    seconds = np.maximum(candidate.seconds[name], 1e-9)
    rates: NDArray[np.float64] = len(candidate.timed[name]) / seconds / 1e6
    return rates


def _empty_row(native: Any, workload: Workload, spec: str, options: Options) -> Row:
    """A row with every key; what is not known is null."""
    known = {} if spec == yardstick.SPEC else specs.values(spec, native.structures())
    return {
        "scene": workload.name,
        "triangles": len(workload.triangles),
        "spec": spec,
        "structure": spec.partition(":")[0],
        "k": known.get("k"),
        "alpha": known.get("alpha"),
        "seed": known.get("seed"),
        "threads": 1 if spec == yardstick.SPEC else options.threads,
        "build_s": None,
        "bytes": None,
        "peak_bytes": None,
        "statistics": None,
        "rays": None,
        "errors": None,
        "curve": None,
        "render_s": None,
        "left_out": [],
        "error": None,
    }


def _failed_row(native: Any, workload: Workload, spec: str, options: Options, error: Exception) -> Row:
    row = _empty_row(native, workload, spec, options)
    row["error"] = (str(error).splitlines() or [type(error).__name__])[0]
    return row
