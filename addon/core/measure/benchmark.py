# SPDX-License-Identifier: GPL-3.0-or-later
"""Benchmark of structures on a scene: first the check of their answers, then the times.

`events` runs it step by step, for callers that show progress and may cancel; `measure` yields the rows alone. Repeats
are interleaved over all structures, so that drift of the machine's speed affects all equally. A structure too slow for
a whole ray set is timed on a part of it, and the row records the number of rays.
"""

from __future__ import annotations

import base64
import uuid
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..base.native import FAILURES, first_line
from ..scene import rays
from ..scene.workload import Workload
from ..structures import specs
from . import accuracy, costmap, counting, first, peak, picture_times, processor, rows, timing, yardstick
from .accuracy import Answers
from .analysis import field
from .inference import LEAST_ROUNDS
from .picture_times import Rounds
from .preparation import REFERENCES, Options, Prepared, Progress, prepare, prepared
from .rows import Row, agrees
from .timing import Candidate
from .two_level import TwoLevel

if TYPE_CHECKING:
    from ..base.interface import Native
    from .yardstick import Traced

__all__ = [
    "REFERENCES",
    "Event",
    "Finished",
    "Options",
    "Prepared",
    "Progress",
    "Row",
    "agrees",
    "events",
    "measure",
    "prepare",
    "prepared",
]

BUILDS = LEAST_ROUNDS
"""Largest number of timed builds, which give an interval; build times vary less than trace times, and take longer."""

BUILD_SECONDS, BRIEF_BUILD_SECONDS = 0.5, 0.05
"""A build that takes longer than this is timed once; the second holds in a brief benchmark."""

ORACLE_SECONDS = 0.5
"""Limit on the timed pass of the reference itself, whose speed is not needed to three digits."""

LIVE_BYTES = 4 << 30
"""Limit on the memory of structures that are measured interleaved."""

BASES = ("kd-sah:traversal=dir,leaves=scalar", "kd-sah:traversal=dir", "kd-sah", "kd:traversal=dir", "kd")
"""Candidates for the base of relative times, in order: the kd-tree built as in the thesis, traversed
like the others.
"""

GROUP = 8
"""Number of configurations that are interleaved; their rows finish together. The anchor is timed in each group."""

USUAL_TRIANGLES = 250_000
"""In a brief benchmark, more triangles than these shorten the passes, whose rays are then slower than usual ones."""

SELF_CHECK = 2048
"""Rays per set on which the reference is compared with itself."""

SCALING_ROUNDS = LEAST_ROUNDS
"""Number of timed passes over each view of the time against the number of rays."""

MAP_SECONDS = 0.5
"""Limit on the expected time of tracing the rays of a cost map."""


@dataclass(frozen=True, eq=False)
class Finished:
    """A complete row."""

    row: Row


Event = Progress | Finished


def measure(
    native: Native, workload: Workload, chosen: Sequence[str], options: Options, say: Callable[[str], None]
) -> Iterator[Row]:
    """Yield one row per configuration as soon as it is complete; arguments as for `events`. say: called with the text
    of each step before it runs.
    """
    for event in events(native, workload, chosen, options):
        if isinstance(event, Finished):
            yield event.row
        else:
            say(f"{workload.name}: {event.text}")


def events(
    native: Native,
    workload: Workload,
    chosen: Sequence[str],
    options: Options,
    shared: Prepared | None = None,
    anchor: str | None = None,
) -> Iterator[Event]:
    """Measure configurations on one scene, a bounded step at a time; yields the text of the next step and each finished
    row.

    chosen: valid configurations, or those of `yardstick.MAKERS`; `embree` names the yardstick. A configuration that
    cannot be built yields a row with the reason in `error`. shared: the result of `prepare` for the same scene and
    options, if several calls share it. anchor: the configuration of `chosen` that is timed with all others, if these
    are only a part of a sweep; found if None.

    Between two items exactly the step that the last Progress announced runs: one build, one comparison, one timed pass
    or one picture. A caller can therefore show the text and continue on any thread; only the arrays of `workload` are
    read, never Blender's data. Close the iterator to cancel; rows already yielded stay valid.
    """
    if shared is None:
        shared = yield from prepare(native, workload, options)
    yield from _Run(native, shared, chosen, anchor).events()


def anchor_of(chosen: Sequence[str]) -> str | None:
    """The configuration that is timed with all others, so that rows of different hours and machines are comparable.

    Embree if it is chosen, else `kd`; in a sweep over k the kd-tree that its times are relative to, which is then
    measured as often as they are, with equally cold caches.
    """
    ks: dict[str, set[str]] = {}
    for spec in chosen:
        ks.setdefault(specs.structure_of(spec), set()).update(value for key, value in specs.pairs(spec) if key == "k")
    swept = any(len(values) > 1 for values in ks.values())
    order = (*(BASES if swept else ()), yardstick.SPEC, "kd")
    return next((spec for spec in order if spec in chosen), None)


class _Run:
    """State of one call of `events`: its configurations and its progress."""

    def __init__(self, native: Native, shared: Prepared, chosen: Sequence[str], anchor: str | None = None) -> None:
        self._native = native
        self._prepared = shared
        self._workload = shared.workload
        self._options = options = shared.options
        # Prefer the caller's anchor: a part of a sweep over k may hold a single k, which does not look like a sweep.
        self._anchor_spec = anchor_of(chosen) if anchor is None else anchor
        self._specs = [spec for spec in chosen if spec != self._anchor_spec]
        self._drawn = sum(not options.brief or rows.is_quickest(native, spec) for spec in chosen)
        passes = len(shared.ray_sets) * (options.repeats + 1) + len(shared.views) * SCALING_ROUNDS
        # Estimate the number of steps per configuration, for the progress: builds, one comparison, timed passes, the
        # peak, the moved grids and the pictures.
        self._builds = min(BUILDS, options.repeats)
        self._steps_each = self._builds + 1 + passes + options.peak + bool(options.offsets) + options.maps
        self._steps_each += 4 * options.tradeoff
        again = options.repeats + 1 if options.curve and not options.brief else 0
        self._steps_each += len(options.curve) + again
        if any(rows.is_lazy(spec) for spec in chosen):
            self._steps_each += options.repeats
        self._total = max(len(chosen), 1) * self._steps_each
        self._count = 0

    def events(self) -> Iterator[Event]:
        """Run everything, in groups of configurations; the anchor is timed in each group and has its
        row in the first.
        """
        anchor = None
        if self._anchor_spec is not None:
            yield self._step(f"{self._anchor_spec}: building")
            try:
                anchor = self._candidate(self._anchor_spec)
            except FAILURES as error:
                yield self._failed(self._anchor_spec, error)
        waiting = [] if anchor is None else [anchor]
        size = 0
        # Build configurations until a group is full or its structures take too much memory, then measure the group.
        for spec in self._specs:
            yield self._step(f"{spec}: building")
            try:
                candidate = self._candidate(spec)
            except FAILURES as error:
                yield self._failed(spec, error)
                continue
            waiting.append(candidate)
            # Embree reports no bytes.
            size += candidate.structure.statistics.get("bytes", 0)
            if len(waiting) >= GROUP or size > LIVE_BYTES:
                yield from self._measure(waiting, anchor)
                waiting, size = [], 0
        if waiting:
            yield from self._measure(waiting, anchor)

    def _step(self, text: str) -> Progress:
        """Count a step. Returns the Progress to yield before the step runs."""
        done = self._done()
        self._count += 1
        return Progress(done, text)

    def _done(self) -> float:
        return min(self._count / self._total, 1.0)

    def _failed(self, spec: str, error: BaseException) -> Finished:
        self._total = max(self._total - self._steps_each, 1)
        return Finished(rows.failed(self._native, self._workload, spec, self._options.threads, error))

    def _candidate(self, spec: str) -> Candidate:
        structure, seconds = self._build(spec)
        return Candidate(spec, structure, [seconds])

    def _build(self, spec: str) -> tuple[Traced, float]:
        """A structure and its build time in seconds: processor time on one thread, else wall-clock time."""
        vertices, triangles = self._workload.vertices, self._workload.triangles
        if yardstick.is_foreign(spec):
            # Foreign tracers build on a number of threads of their own choice.
            found = yardstick.MAKERS[spec](vertices, triangles)
            return found, float(found.statistics["build_seconds"])
        options = self._options
        clock = timing.clock(options.threads)
        start = clock()
        structure: Traced
        if options.layout == "two-level":
            structure = TwoLevel(self._native, self._workload, spec, options.top, options.threads, options.memory_limit)
        else:
            structure = self._native.build(
                vertices, triangles, spec, threads=options.threads, memory_limit=options.memory_limit
            )
        return structure, clock() - start

    def _measure(self, group: list[Candidate], anchor: Candidate | None) -> Iterator[Event]:
        """Measure all built configurations of one group, then yield their rows."""
        yield from self._time_builds(group)
        # Check the answers; configurations that fail here are not timed.
        sound: list[Candidate] = []
        for candidate in group:
            yield self._step(f"{candidate.spec}: comparing answers with those of {self._options.reference}")
            try:
                self._check(candidate)
                sound.append(candidate)
            except FAILURES as error:
                yield self._failed(candidate.spec, error)
        # Time the anchor with every group. Later groups use a copy, which is not checked again and gets no second row.
        timed_anchor = None
        if anchor is not None and anchor.timed:
            timed_anchor = anchor if anchor in sound else anchor.again()
        timed = sound if timed_anchor is None or timed_anchor in sound else [timed_anchor, *sound]
        # Time the ray sets, and everything that needs sound answers.
        for rays_of_set in self._prepared.ray_sets:
            steps = timing.rounds(timed, rays_of_set.name, self._options.repeats, self._options.threads)
            yield from map(self._step, steps)
        yield from self._count_events(sound)
        yield from map(self._step, timing.scaling(sound, self._prepared.views, SCALING_ROUNDS, self._options))
        yield from self._first_pictures(sound)
        ours = [candidate for candidate in sound if not yardstick.is_foreign(candidate.spec)]
        yield from self._extras(ours)
        yield from self._errors_against_time(sound)
        yield from self._draw(ours)
        # Time pictures, then complete the rows.
        pictures = Rounds()
        if self._prepared.pictures is not None and not self._options.brief:
            steps = picture_times.time(pictures, self._prepared.pictures, self._prepared.anchor, ours, self._options)
            yield from map(self._step, steps)
        round_id = uuid.uuid4().hex[:12]
        for candidate in sound:
            yield Finished(self._row(candidate, timed_anchor, timed, pictures, round_id))

    def _time_builds(self, group: list[Candidate]) -> Iterator[Event]:
        """Repeat short builds up to BUILDS times, interleaved."""
        most = BRIEF_BUILD_SECONDS if self._options.brief else BUILD_SECONDS
        for _ in range(self._builds - 1):
            for candidate in group:
                yield self._step(f"{candidate.spec}: building again")
                if candidate.build_seconds[0] <= most:
                    candidate.build_seconds.append(self._build(candidate.spec)[1])

    def _count_events(self, candidates: Sequence[Candidate]) -> Iterator[Event]:
        """Count cache misses and instructions of one more pass over each set, where the system does."""
        if processor.refusal(self._native) is not None:
            return
        for candidate in candidates:
            yield Progress(self._done(), f"{candidate.spec}: counting cache misses")
            for name, some in candidate.timed.items():
                candidate.events[name] = processor.per_ray(self._native, candidate, some, self._options.threads)

    def _first_pictures(self, group: Sequence[Candidate]) -> Iterator[Event]:
        for view in (one for one in self._prepared.ray_sets if one.name == "primary"):
            yield from map(
                self._step, first.rounds(self._build, group, view, self._options.repeats, self._options.threads)
            )

    def _check(self, candidate: Candidate) -> None:
        """Compare nearest hits and any-hits with the reference, count steps, and choose the number of rays to time."""
        options, structure = self._options, candidate.structure
        for whole in self._prepared.ray_sets:
            some, right = self._prepared.checked[whole.name], self._prepared.expected[whole.name]
            if candidate.spec == options.reference:
                # A comparison with itself only has to show that the answers do not depend on the number of threads.
                own = rays.blocks(len(some), SELF_CHECK, options.seed)
                some, right = some.take(own), right.take(own)
            arguments = some.options(options.threads)
            if rows.is_lazy(candidate.spec):
                # The first pass extends a lazily built tree for these rays; the second is checked and timed.
                structure.closest(some.origins, some.directions, **arguments)
            # Use the clock of the timed passes: under load, the other clock would make a fast structure look slow.
            now = timing.clock(options.threads)
            start = now()
            answers = Answers.of(structure.closest(some.origins, some.directions, **arguments))
            seconds = now() - start
            occluded = structure.occluded(some.origins, some.directions, **arguments)
            candidate.errors[whole.name] = accuracy.compare(
                right, answers, occluded, self._native.ulp_distance, bitwise=options.reference == "brute"
            )
            # Limit the timed rays by the speed just measured.
            limit = options.pass_seconds
            if options.brief:
                limit *= min(1.0, USUAL_TRIANGLES / max(len(self._workload.triangles), 1))
            if candidate.spec == options.reference:
                limit = min(limit, ORACLE_SECONDS)
            candidate.checked[whole.name] = len(some) / max(seconds, 1e-9) / 1e6
            candidate.timed[whole.name] = timing.affordable(whole, candidate.checked[whole.name], limit, options.seed)
            hits = float(answers.hit.mean()) if len(some) else 0.0
            candidate.counted[whole.name] = {"hits": hits, **timing.count(candidate, some, options.threads)}
            if not yardstick.is_foreign(candidate.spec) and len(some):
                counters = counting.counters(candidate.native, some, options.threads)
                candidate.work[whole.name] = field.work(counters, answers.hit)
        # Copy the statistics now: each further pass over a lazily built tree adds nodes.
        candidate.statistics = dict(structure.statistics)
        if options.shapes and not isinstance(structure, (yardstick.Foreign, TwoLevel)):
            candidate.shape = field.shape(structure)

    def _extras(self, candidates: Sequence[Candidate]) -> Iterator[Event]:
        """Measure peak memory, cost maps, and wrong answers far from the origin. A failure here is noted in the row."""
        if self._options.peak and (measured := [one for one in candidates if self._is_whole(one)]):
            try:
                scene = peak.save_scene(self._workload.vertices, self._workload.triangles)
            except OSError as error:
                for candidate in measured:
                    candidate.left_out.append(f"peak memory: {first_line(error)}")
            else:
                try:
                    for text, begins in peak.of_builds(self._native, measured, scene, self._options):
                        yield self._step(text) if begins else Progress(self._done(), text)
                finally:
                    scene.unlink(missing_ok=True)
        if self._prepared.map_view is not None:
            yield from self._maps(candidates)
        if self._prepared.moved is not None:
            for candidate in candidates:
                yield self._step(f"{candidate.spec}: far from the origin")
                try:
                    candidate.offsets = self._prepared.moved.errors(candidate.spec)
                except FAILURES as error:
                    candidate.left_out.append(f"answers far from the origin: {first_line(error)}")

    def _is_whole(self, candidate: Candidate) -> bool:
        """Whether a configuration gets all measurements: in a brief benchmark the usually quickest of each tree."""
        return not self._options.brief or rows.is_quickest(self._native, candidate.spec)

    def _errors_against_time(self, candidates: Sequence[Candidate]) -> Iterator[Event]:
        """Measure errors with and without bounds. A failure is noted in the row."""
        scenes = self._prepared.tradeoff
        if scenes is None:
            return
        for candidate in candidates:
            if not (yardstick.is_foreign(candidate.spec) or self._is_whole(candidate)):
                continue
            try:
                steps = scenes.points(candidate)
                while True:
                    yield self._step(f"{candidate.spec}: errors against time")
                    points = next(steps, None)
                    if points is None:
                        break
                    candidate.tradeoff += points
            except FAILURES as error:
                candidate.left_out.append(f"errors against time: {first_line(error)}")

    def _maps(self, candidates: Sequence[Candidate]) -> Iterator[Event]:
        """Count the work per pixel of the candidates that trace the view within MAP_SECONDS."""
        view, size = self._prepared.map_view, self._prepared.map_size
        assert view is not None
        for candidate in candidates:
            yield self._step(f"{candidate.spec}: what each pixel costs")
            if len(view) <= candidate.checked.get("primary", 1.0) * 1e6 * MAP_SECONDS:
                assert not isinstance(candidate.structure, (yardstick.Foreign, TwoLevel)), "see `Options`"
                candidate.cost_map = costmap.packed(costmap.work(candidate.structure, view, size))

    def _draw(self, candidates: Sequence[Candidate]) -> Iterator[Event]:
        """Render pictures with a growing number of samples, interleaved over the configurations."""
        pictures = self._prepared.pictures
        if pictures is None:
            return
        # Divide the time among the configurations that get more than the first picture.
        share = pictures.share(self._drawn)
        for samples in pictures.samples:
            for candidate in candidates:
                yield self._step(f"{candidate.spec}: rendering with {samples} samples per pixel")
                # A set is empty if it starts at hits and no ray hits the scene.
                traced = [name for name in candidate.seconds if len(candidate.timed[name])]
                slowest = min((float(candidate.mrays(name).min()) for name in traced), default=1.0)
                wanted = pictures.samples if self._is_whole(candidate) else pictures.samples[:1]
                if samples not in wanted or samples not in pictures.affordable(slowest):
                    continue
                spent = [point["seconds"] for point in candidate.curve]
                if spent and sum(spent) + spent[-1] * samples / candidate.curve[-1]["spp"] > share:
                    continue
                point, differing = pictures.point(candidate.native, samples, self._options.threads)
                candidate.curve.append(point)
                candidate.differing_pixels += differing

    def _row(
        self,
        candidate: Candidate,
        anchor: Candidate | None,
        group: Sequence[Candidate],
        pictures: Rounds,
        round_id: str,
    ) -> Row:
        """The complete row of a candidate; group: all candidates timed with it, for the noise estimate."""
        options = self._options
        statistics = dict(candidate.statistics)
        row = rows.empty(self._native, self._workload, candidate.spec, options.threads)
        row["round_id"] = round_id
        row["anchor"] = None if anchor is None else anchor.spec
        row["build_s"] = rows.spread(candidate.build_seconds)
        row["first_s"] = rows.spread(candidate.first_seconds) if candidate.first_seconds else None
        row["bytes"] = statistics.get("bytes")
        row["peak_bytes"] = candidate.peak_bytes
        row["left_out"] = [*statistics.pop("left_out", []), *candidate.left_out]
        row["statistics"] = statistics
        row["rays"] = {
            one.name: timing.speeds(candidate, one.name, anchor, timing.noise(group, one.name))
            for one in self._prepared.ray_sets
        }
        if isinstance(candidate.structure, TwoLevel):
            row["layout"] = f"two levels, the upper one by {options.top}"
        if not yardstick.is_foreign(candidate.spec):
            counting.mark(row["rays"], self._prepared.ray_sets, candidate.native)
            rows.add_ways(row, counting.ways(candidate.native, self._prepared.ray_sets))
        # Add errors: in total, per ray set, and in pictures.
        row["errors"] = accuracy.total(candidate.errors.values()).as_row(options.reference)
        row["errors"]["sets"] = {name: errors.as_row(options.reference) for name, errors in candidate.errors.items()}
        # Pixels that differ from the first structure's picture; 0 if nothing was rendered.
        row["errors"]["differing_pixels"] = candidate.differing_pixels
        row["map"] = candidate.cost_map
        row["scaling"] = candidate.scaling or None
        row["offsets"] = candidate.offsets or None
        row["tradeoff"] = candidate.tradeoff
        row["field"] = {"tree": candidate.shape, "rays": candidate.work}
        # One row of each group holds the picture of the scene.
        if candidate is group[0] and self._prepared.portrait is not None:
            row["portrait"] = base64.b64encode(self._prepared.portrait).decode("ascii")
        self._add_pictures(row, candidate, pictures)
        return row

    def _add_pictures(self, row: Row, candidate: Candidate, timed: Rounds) -> None:
        """Add a candidate's pictures to its row, and note sample counts that were too slow."""
        pictures = self._prepared.pictures
        if candidate.curve:
            assert pictures is not None, "it drew the curve"
            row["curve"] = candidate.curve
            row["independent"] = pictures.independent
            row["converged"] = pictures.converged
            row["peer"] = pictures.peer
            row["image"] = timed.of(candidate)
            row["image_s"] = picture_times.picture_seconds(pictures, candidate, row["image"])
            row["render_s"] = candidate.curve[-1]["seconds"]
        rendered = {point["spp"] for point in candidate.curve}
        left = [] if pictures is None else [n for n in pictures.samples if n not in rendered]
        if left and not yardstick.is_foreign(candidate.spec):
            samples = ", ".join(map(str, left))
            row["too_slow"].append(f"pictures with {samples} samples per pixel: they would take too long")
