# SPDX-License-Identifier: GPL-3.0-or-later
"""Measuring structures on a scene: first the proof that the answers are right, then the time.

`events` does it step by step, for whoever shows progress and may want to stop; `measure` gives the rows alone. Repeats
are interleaved over all structures, so that a machine that slows down hurts all alike. A structure too slow for the
whole of a ray set is timed on a part of it, and the row tells how many rays that were.
"""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from . import accuracy, curve, peak, rays, rows, timing, yardstick
from .accuracy import Answers
from .offsets import Moved
from .rays import RaySet
from .rows import Row, agrees, first_line
from .timing import Candidate
from .workload import Workload

__all__ = ["Event", "Finished", "Options", "Prepared", "Progress", "Row", "agrees", "events", "measure", "prepare"]

BUILDS = 3
"""A build is timed this often at most; it varies less than tracing, and takes longer."""

BUILD_SECONDS = 5.0
"""A build that takes longer is timed once."""

PASS_SECONDS = 5.0
"""One timed pass over a ray set takes about this long at most; slower structures get fewer rays."""

ORACLE_SECONDS = 0.5
"""The same for the reference itself, whose speed interests nobody to three digits."""

LIVE_BYTES = 4 << 30
"""Structures that are measured interleaved share this much memory at most."""

SELF_CHECK = 2048
"""Rays per set on which the reference is compared with itself."""

SCALING = (8, 4, 2)
"""The view is also timed with its sides divided by these."""

SCALING_ROUNDS = 3

REFERENCES = ("brute", "exact", "embree")


@dataclass(frozen=True)
class Options:
    """What is measured. size: width and height of the view; check_rays: rays per set compared with the reference.

    threads: for builds and tracing. seed: of the rays. curve: samples per pixel of the pictures. offsets: how far away
    the grid of touching boxes is put. scaling: whether views of fewer pixels are timed. peak: whether each build is
    done once more in a process of its own, for its memory. pass_seconds: how long one timed pass may take.
    """

    size: tuple[int, int] = (1024, 1024)
    sets: tuple[str, ...] = rays.NAMES
    repeats: int = 7
    threads: int = 1
    reference: str = "brute"
    check_rays: int = 20_000
    seed: int = 1
    curve: tuple[int, ...] = ()
    offsets: tuple[float, ...] = ()
    scaling: bool = False
    peak: bool = False
    pass_seconds: float = PASS_SECONDS

    def as_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(self).items()}

    def identity(self) -> dict[str, Any]:
        """What a finished row depends on; how long a pass may take only says how many rays are timed."""
        return {key: value for key, value in self.as_dict().items() if key != "pass_seconds"}


@dataclass(frozen=True)
class Progress:
    """What is done next, and which share of everything was done before, 0 to 1."""

    done: float
    text: str


@dataclass(frozen=True, eq=False)
class Finished:
    """A row is complete."""

    row: Row


Event = Progress | Finished


@dataclass(eq=False)
class Prepared:
    """The rays of a scene, what the reference answers to those that are checked, and what else all structures share."""

    workload: Workload
    options: Options
    ray_sets: list[RaySet]
    checked: dict[str, RaySet]
    expected: dict[str, Answers]
    views: list[RaySet]
    pictures: curve.Curve | None
    moved: Moved | None


def measure(
    native: Any, workload: Workload, chosen: Sequence[str], options: Options, say: Callable[[str], None]
) -> Iterator[Row]:
    """One row per configuration, as soon as it is complete; arguments as for `events`. say: told what is done next."""
    for event in events(native, workload, chosen, options):
        if isinstance(event, Finished):
            yield event.row
        else:
            say(f"{workload.name}: {event.text}")


def events(
    native: Any, workload: Workload, chosen: Sequence[str], options: Options, prepared: Prepared | None = None
) -> Iterator[Event]:
    """Measure configurations on one scene, a bounded step at a time; yields what comes next, and each finished row.

    chosen: valid configurations; `embree` names the yardstick. A configuration that cannot be built gives a row whose
    `error` says why. prepared: what `prepare` made of the same scene and options, where several calls share it.

    Between two items exactly the step that the last Progress announced is done: one build, one comparison, one timed
    pass, one picture. So a caller can show the text, and then go on, on any thread: Blender's data is never touched,
    only the arrays of `workload`. To cancel, close the iterator (or stop asking): rows that were yielded stay valid.
    """
    if prepared is None:
        prepared = yield from prepare(native, workload, options)
    yield from _Run(native, prepared, chosen).events()


def prepare(native: Any, workload: Workload, options: Options) -> Generator[Event, None, Prepared]:
    """The part of the work that all configurations of a scene share; a generator like `events`, which returns it."""
    yield Progress(0.0, "making the rays")
    tracer = native.build(workload.vertices, workload.triangles, _tracer_spec(native), threads=0)
    ray_sets = rays.make(workload, tracer, size=options.size, seed=options.seed, names=options.sets)
    checked = {}
    for rays_of_set in ray_sets:
        wanted = len(rays_of_set) if rays_of_set in workload.extra else options.check_rays
        checked[rays_of_set.name] = rays_of_set.take(rays.blocks(len(rays_of_set), wanted, options.seed))
    count = sum(map(len, checked.values()))
    yield Progress(0.0, f"{count:,} rays by {options.reference}, the reference")
    expected = _reference(native, workload, checked, options)
    moved = None
    if options.offsets:
        yield Progress(0.0, "moving the grid of touching boxes")
        moved = Moved(native, options.offsets, options.seed)
    pictures = None
    if options.curve:
        pictures = curve.Curve(native, workload, options.size, options.curve, options.seed)
        yield Progress(0.0, "rendering the converged picture")
        pictures.converge(tracer)
    views = list(_smaller_views(workload, tracer, options)) if options.scaling and "primary" in options.sets else []
    return Prepared(workload, options, ray_sets, checked, expected, views, pictures, moved)


def _tracer_spec(native: Any) -> str:
    ids = [row["id"] for row in native.structures()]
    return "kd" if "kd" in ids else "brute"


def _smaller_views(workload: Workload, tracer: Any, options: Options) -> Iterator[RaySet]:
    """The primary rays of the same view in fewer pixels, the fewest first."""
    for divisor in SCALING:
        width, height = (max(rays.TILE, side // divisor // rays.TILE * rays.TILE) for side in options.size)
        (view,) = rays.make(workload, tracer, size=(width, height), seed=options.seed, names=("primary",))[:1]
        yield view


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


class _Run:
    """One call of `events`: its configurations, and how much of the work is done."""

    def __init__(self, native: Any, prepared: Prepared, chosen: Sequence[str]) -> None:
        self._native = native
        self._prepared = prepared
        self._workload = prepared.workload
        self._options = options = prepared.options
        self._with_yardstick = yardstick.SPEC in chosen
        self._specs = [spec for spec in chosen if spec != yardstick.SPEC]
        self._round_id = uuid.uuid4().hex[:12]
        passes = len(prepared.ray_sets) * (options.repeats + 1) + len(prepared.views) * SCALING_ROUNDS
        # Builds, one comparison, timed passes, the peak, the moved grids, pictures.
        self._steps_each = min(BUILDS, options.repeats) + 1 + passes + options.peak + bool(options.offsets)
        self._steps_each += len(options.curve)
        self._total = max(len(chosen), 1) * self._steps_each
        self._count = 0

    def events(self) -> Iterator[Event]:
        """Everything, in groups of configurations that fit into memory together; the yardstick is in each group."""
        group: list[Candidate] = []
        size = 0
        for number, spec in enumerate(self._specs):
            yield self._step(f"{spec}: building")
            try:
                candidate = Candidate(spec, self._build(spec))
            except (ValueError, RuntimeError, MemoryError) as error:
                yield self._failed(spec, error)
                continue
            group.append(candidate)
            size += candidate.structure.statistics["bytes"]
            if size > LIVE_BYTES and number + 1 < len(self._specs):
                yield from self._measure(group)
                group, size = [], 0
        yield from self._measure(group)

    def _step(self, text: str) -> Progress:
        done = min(self._count / self._total, 1.0)
        self._count += 1
        return Progress(done, text)

    def _failed(self, spec: str, error: BaseException) -> Finished:
        self._total = max(self._total - self._steps_each, 1)
        return Finished(rows.failed(self._native, self._workload, spec, self._options.threads, error))

    def _build(self, spec: str) -> Any:
        if spec == yardstick.SPEC:
            return yardstick.EmbreeStructure(self._workload.vertices, self._workload.triangles)
        return self._native.build(
            self._workload.vertices, self._workload.triangles, spec, threads=self._options.threads
        )

    def _measure(self, group: list[Candidate]) -> Iterator[Event]:
        """Everything about the built configurations of one group, then their rows."""
        if self._with_yardstick:
            group = [Candidate(yardstick.SPEC, self._build(yardstick.SPEC)), *group]
        yield from self._time_builds(group)
        sound: list[Candidate] = []
        for candidate in group:
            yield self._step(f"{candidate.spec}: comparing answers with those of {self._options.reference}")
            try:
                self._prove(candidate)
                sound.append(candidate)
            except (ValueError, RuntimeError, MemoryError) as error:
                yield self._failed(candidate.spec, error)
        for rays_of_set in self._prepared.ray_sets:
            steps = timing.rounds(sound, rays_of_set.name, self._options.repeats, self._options.threads)
            yield from map(self._step, steps)
        yield from map(self._step, timing.scaling(sound, self._prepared.views, SCALING_ROUNDS, self._options))
        ours = [candidate for candidate in sound if candidate.spec != yardstick.SPEC]
        yield from self._extras(ours)
        yield from self._draw(ours)
        base = next((c for c in sound if c.spec == yardstick.SPEC), None)
        for candidate in sound:
            yield Finished(self._row(candidate, base, sound))

    def _time_builds(self, group: list[Candidate]) -> Iterator[Event]:
        for candidate in group:
            candidate.build_seconds.append(candidate.structure.statistics["build_seconds"])
        for _ in range(min(self._options.repeats, BUILDS) - 1):
            for candidate in group:
                yield self._step(f"{candidate.spec}: building again")
                if candidate.build_seconds[0] <= BUILD_SECONDS:
                    candidate.build_seconds.append(self._build(candidate.spec).statistics["build_seconds"])

    def _prove(self, candidate: Candidate) -> None:
        """Compare closest and any hits with the reference, count steps, and choose how many rays can be timed."""
        options, structure = self._options, candidate.structure
        for whole in self._prepared.ray_sets:
            some, right = self._prepared.checked[whole.name], self._prepared.expected[whole.name]
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
                right, answers, occluded, self._native.ulp_distance, bitwise=options.reference == "brute"
            )
            limit = options.pass_seconds
            if candidate.spec == options.reference:
                limit = min(limit, ORACLE_SECONDS)
            candidate.checked[whole.name] = len(some) / max(seconds, 1e-9) / 1e6
            candidate.timed[whole.name] = timing.affordable(whole, candidate.checked[whole.name], limit, options.seed)
            hits = float(answers.hit.mean()) if len(some) else 0.0
            candidate.counted[whole.name] = {"hits": hits, **timing.count(candidate, some, arguments)}

    def _extras(self, candidates: Sequence[Candidate]) -> Iterator[Event]:
        """Peak memory, and wrong answers far from the origin. Neither failing takes the row away."""
        if self._options.peak and candidates:
            try:
                scene = peak.save_scene(self._workload.vertices, self._workload.triangles)
            except OSError as error:
                for candidate in candidates:
                    candidate.left_out.append(f"peak memory: {first_line(error)}")
            else:
                try:
                    yield from self._peaks(candidates, scene)
                finally:
                    scene.unlink(missing_ok=True)
        if self._prepared.moved is not None:
            for candidate in candidates:
                yield self._step(f"{candidate.spec}: far from the origin")
                try:
                    candidate.offsets = self._prepared.moved.errors(candidate.spec)
                except (ValueError, RuntimeError, MemoryError) as error:
                    candidate.left_out.append(f"answers far from the origin: {first_line(error)}")

    def _peaks(self, candidates: Sequence[Candidate], scene: Path) -> Iterator[Event]:
        for candidate in candidates:
            yield self._step(f"{candidate.spec}: building in a process of its own, for the memory")
            try:
                candidate.peak_bytes = peak.of_build(self._native, scene, candidate.spec, self._options.threads)
            except peak.PeakError as error:
                candidate.left_out.append(f"peak memory: {first_line(error)}")

    def _draw(self, candidates: Sequence[Candidate]) -> Iterator[Event]:
        """Render pictures with growing numbers of samples, interleaved over the configurations."""
        pictures = self._prepared.pictures
        if pictures is None:
            return
        for samples in self._options.curve:
            for candidate in candidates:
                yield self._step(f"{candidate.spec}: rendering with {samples} samples per pixel")
                slowest = min((float(candidate.mrays(name).min()) for name in candidate.seconds), default=1.0)
                if samples in pictures.affordable(slowest):
                    point, differing = pictures.point(candidate.structure, samples, self._options.threads)
                    candidate.curve.append(point)
                    candidate.differing_pixels += differing

    def _row(self, candidate: Candidate, base: Candidate | None, group: Sequence[Candidate]) -> Row:
        options = self._options
        statistics = dict(candidate.structure.statistics)
        row = rows.empty(self._native, self._workload, candidate.spec, options.threads)
        row["round_id"] = self._round_id
        row["build_s"] = rows.spread(candidate.build_seconds)
        row["bytes"] = statistics.get("bytes")
        row["peak_bytes"] = candidate.peak_bytes
        row["left_out"] = [*statistics.pop("left_out", []), *candidate.left_out]
        row["statistics"] = statistics
        row["rays"] = {
            one.name: timing.speeds(candidate, one.name, base, timing.noise(group, one.name))
            for one in self._prepared.ray_sets
        }
        row["errors"] = accuracy.total(candidate.errors.values()).as_row(options.reference)
        row["errors"]["sets"] = {name: errors.as_row(options.reference) for name, errors in candidate.errors.items()}
        # Pixels in which a picture is not that of the first structure; 0 where nothing was rendered.
        row["errors"]["differing_pixels"] = candidate.differing_pixels
        row["scaling"] = candidate.scaling or None
        row["offsets"] = candidate.offsets or None
        if candidate.curve:
            row["curve"] = candidate.curve
            row["render_s"] = candidate.curve[-1]["seconds"]
        left = [n for n in options.curve if n not in {point["spp"] for point in candidate.curve}]
        if left and candidate.spec != yardstick.SPEC:
            samples = ", ".join(map(str, left))
            row["left_out"].append(f"pictures with {samples} samples per pixel: they would take too long")
        return row
