# SPDX-License-Identifier: GPL-3.0-or-later
"""Data shared by all configurations of a scene: options, rays, reference answers and the converged picture."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Generator, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from ..base import room
from ..base.native import FAILURES, first_line
from ..scene import rays
from ..scene.instances import TOPS
from ..scene.rays import RaySet
from ..scene.workload import Workload
from . import costmap, curve, two_level, yardstick
from .accuracy import Answers
from .analysis.tradeoff import Limits, Tradeoff
from .offsets import Moved
from .reference import affordable

if TYPE_CHECKING:
    from ..base.interface import HitArrays, Native, Structure, Tracer
    from .yardstick import Traced

PASS_SECONDS = 5.0
"""Limit on the seconds of one timed pass over a ray set; slower structures get fewer rays."""

SCALING = (16, 8, 4, 2)
"""Divisors of the view's sides for the additional, smaller views."""

MAP_SIDE = 96
"""Longer side of the cost maps in pixels."""

KEPT_BYTES = 1 << 30
"""Largest size of the ray-making tree that is kept as the anchor for picture times."""

BLOCK = rays.TILE * rays.TILE
"""Rays of a block. However many triangles there are, one block of each set is compared with the reference."""

REFERENCES = ("brute", "exact", "embree")


@dataclass(frozen=True)
class Options:
    """Options of a benchmark. size: width and height of the view; check_rays: rays per set compared with the reference.
    own_rays: the same for the scene's own ray sets, None for all of their rays. check_tests: triangle tests that the
    reference may make for those sets together, and again for all others, None for any number; many triangles then get
    fewer rays than these. own: a hash of the user's ray sets, which are among the scene's own, "" without any.

    threads: for builds and tracing. level: the instruction set, "best" or as `native.level()` names it. seed: of
    the rays. curve: samples per pixel of the pictures. picture_seconds: limit on all of them, about. offsets: distances
    of the moved grid of touching boxes. scaling: whether smaller views are timed. tradeoff: whether errors are measured
    against the time of a ray, with and without error bounds. peak: whether each build is repeated in its own process,
    to measure its memory. maps: whether cost maps are kept. shapes: whether the statistics of trees are computed, which
    takes longer than the build of a kd-tree. pass_seconds: limit on one timed pass. brief: for many configurations:
    pictures, and builds that are not short, are timed once, and only the usually quickest configuration of each tree
    gets errors against time, pictures with more than the fewest samples and a measurement of peak memory.
    layout, top: of `two_level` and `instances.TOPS`, whether structures are built over each mesh, and the tree above.
    memory_limit: bytes that a build may use, None for the native module's limit; a configuration that needs more yields
    a row with the reason in `error`.
    """

    size: tuple[int, int] = (1024, 1024)
    sets: tuple[str, ...] = rays.NAMES
    repeats: int = 7
    threads: int = 1
    level: str = "best"
    reference: str = "brute"
    check_rays: int = 20_000
    own_rays: int | None = None
    own: str = ""
    check_tests: int | None = None
    seed: int = 1
    curve: tuple[int, ...] = ()
    picture_seconds: float | None = None
    offsets: tuple[float, ...] = ()
    scaling: bool = False
    tradeoff: bool = False
    peak: bool = False
    maps: bool = False
    shapes: bool = True
    pass_seconds: float = PASS_SECONDS
    memory_limit: int | None = None
    brief: bool = False
    layout: two_level.Layout = "flatten"
    top: str = TOPS[0]

    def as_dict(self) -> dict[str, Any]:
        """The options as a JSON object."""
        return {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(self).items()}

    def identity(self) -> dict[str, Any]:
        """The options that a finished row depends on; pass_seconds only changes the number of timed rays, and rows that
        are kept have shapes.
        """
        return {key: value for key, value in self.as_dict().items() if key not in ("pass_seconds", "shapes")}


@dataclass(frozen=True)
class Progress:
    """The next step, and the share of all steps done before it, 0 to 1."""

    done: float
    text: str


@dataclass(eq=False)
class Prepared:
    """The rays of a scene, the reference's answers to those that are checked, and other data that all structures share.

    anchor: of picture times; None without pictures or if it is too large to be kept. portrait: a PNG of the scene, None
    without pictures.
    """

    workload: Workload
    options: Options
    ray_sets: list[RaySet]
    checked: dict[str, RaySet]
    expected: dict[str, Answers]
    views: list[RaySet]
    pictures: curve.Curve | None
    moved: Moved | None
    map_view: RaySet | None = None
    map_size: tuple[int, int] = (0, 0)
    anchor: Structure | None = None
    tradeoff: Tradeoff | None = None
    portrait: bytes | None = None


def compared(workload: Workload, options: Options) -> int:
    """Number of rays per set that are compared with the reference, except of the scene's own sets."""
    return _within(workload, options, len(options.sets), options.check_rays)


def compared_own(workload: Workload, options: Options) -> int:
    """The same of each of the scene's own sets; a smaller set is compared entirely."""
    most = max(map(len, workload.extra), default=0) if options.own_rays is None else options.own_rays
    return _within(workload, options, len(workload.extra), most)


def _within(workload: Workload, options: Options, sets: int, most: int) -> int:
    """At most this number of rays for each of `sets` sets, fewer if the reference would make too many tests."""
    if options.check_tests is None or options.reference == yardstick.SPEC:
        return most
    within = affordable(workload, sets, options.check_tests)
    return min(most, max(within // BLOCK * BLOCK, BLOCK))


def check_room(native: Native, options: Options) -> None:
    """Raise MemoryError if there is not enough memory for the rays of a view of this size."""
    width, height = options.size
    room.check(native, f"the rays of {width}x{height} pixels", rays.bytes_needed(options.size, options.sets))


def prepare(native: Native, workload: Workload, options: Options) -> Generator[Progress, None, Prepared]:
    """The work shared by all configurations of a scene, as a generator that yields its steps and returns the result.

    Raises MemoryError, before any allocation, if the rays do not fit into memory.
    """
    check_room(native, options)
    if options.layout == "two-level":
        two_level.geometry_of(workload)
    yield Progress(0.0, "making the rays")
    tracer = _tracer(native, workload, options)
    ray_sets = rays.make(workload, tracer, size=options.size, seed=options.seed, names=options.sets)
    # Select the rays to check, and answer them with the reference.
    checked, usual, own = {}, compared(workload, options), compared_own(workload, options)
    for rays_of_set in ray_sets:
        wanted = own if rays_of_set in workload.extra else usual
        checked[rays_of_set.name] = rays_of_set.take(rays.blocks(len(rays_of_set), wanted, options.seed))
    count = sum(map(len, checked.values()))
    yield Progress(0.0, f"{count:,} rays by {options.reference}, the reference")
    expected = _reference(native, workload, checked, options)
    moved = None
    if options.offsets:
        yield Progress(0.0, "moving the grid of touching boxes")
        moved = Moved(native, options.offsets, options.seed)
    # Render the converged picture.
    pictures, portrait = None, None
    if options.curve:
        seconds = math.inf if options.picture_seconds is None else options.picture_seconds
        pictures = curve.Curve(native, workload, options.size, options.curve, options.seed, seconds=seconds)
        yield Progress(0.0, "rendering the pictures of all structures")
        pictures.converge(tracer)
        yield Progress(0.0, "rendering the report's picture")
        with contextlib.suppress(ImportError):  # a Blender may lack OpenImageIO
            portrait = pictures.portrait(tracer)
        if workload.peer is not None:
            yield Progress(0.0, f"rendering with {workload.peer.name}")
            assert pictures.converged is not None, "it was rendered"
            try:
                pictures.meet(workload.peer, options.threads)
            except FAILURES as error:
                pictures.converged["peer"] = first_line(error)
    # Make the smaller views, and the view of the cost maps.
    views = list(_smaller_views(workload, tracer, options)) if options.scaling and "primary" in options.sets else []
    made = Prepared(workload, options, ray_sets, checked, expected, views, pictures, moved, portrait=portrait)
    if options.tradeoff:
        yield Progress(0.0, "moving the scene far away")
        limits = Limits(options.threads, options.memory_limit, options.brief)
        pairs = {name: (some, expected[name]) for name, some in checked.items()}
        made.tradeoff = Tradeoff(native, workload, pairs, options.seed, limits)
    if pictures is not None and tracer.statistics["bytes"] <= KEPT_BYTES:
        made.anchor = tracer
    if options.maps:
        width, height = (round(side * MAP_SIDE / max(options.size)) for side in options.size)
        made.map_size = costmap.rounded((width, height))
        (made.map_view,) = rays.make(workload, tracer, size=made.map_size, seed=options.seed, names=("primary",))[:1]
    return made


def prepared(native: Native, workload: Workload, options: Options) -> Prepared:
    """The same without intermediate steps."""
    steps = prepare(native, workload, options)
    while True:
        try:
            next(steps)
        except StopIteration as end:
            found: Prepared = end.value
            return found


TRACERS = ("kd", "bvh-sah")
"""Structures that make the rays, fastest first; the second needs half the memory."""


def _tracer(native: Native, workload: Workload, options: Options) -> Structure:
    """The fastest structure that fits into memory. Raises MemoryError if none does."""
    ids = {row["id"] for row in native.structures()}
    *others, last = [spec for spec in TRACERS if spec in ids] or ["brute"]
    build = partial(native.build, workload.vertices, workload.triangles, threads=0, memory_limit=options.memory_limit)
    for spec in others:
        with contextlib.suppress(MemoryError):
            return build(spec)
    return build(last)


def _smaller_views(workload: Workload, tracer: Tracer, options: Options) -> Iterator[RaySet]:
    """The primary rays of the same view with fewer pixels, smallest first."""
    across, down = options.size
    least = rays.TILE
    sizes = [(max(least, across // n // least * least), max(least, down // n // least * least)) for n in SCALING]
    for width, height in dict.fromkeys(sizes):
        (view,) = rays.make(workload, tracer, size=(width, height), seed=options.seed, names=("primary",))[:1]
        yield view


def _reference(native: Native, workload: Workload, checked: dict[str, RaySet], options: Options) -> dict[str, Answers]:
    """The reference's answers to the checked rays of each set, on all cores."""
    vertices, triangles = workload.vertices, workload.triangles
    found = {}
    structure: Traced | None = None
    hits: HitArrays
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
