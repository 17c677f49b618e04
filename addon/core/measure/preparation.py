# SPDX-License-Identifier: GPL-3.0-or-later
"""What all configurations of a scene share: options, rays, what the reference answers, the converged picture."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from ..base import room
from ..scene import rays
from ..scene.rays import RaySet
from ..scene.workload import Workload
from . import costmap, curve, yardstick
from .accuracy import Answers
from .offsets import Moved

if TYPE_CHECKING:
    from ..base.interface import HitArrays, Native, Structure, Tracer
    from .yardstick import Traced

PASS_SECONDS = 5.0
"""One timed pass over a ray set takes about this long at most; slower structures get fewer rays."""

SCALING = (16, 8, 4, 2)
"""The view is also timed with its sides divided by these."""

MAP_SIDE = 96
"""Pixels along the longer side of the maps of what each pixel costs."""

KEPT_BYTES = 1 << 30
"""The tree that made the rays is kept to keep time for pictures, unless it takes more memory than this."""

REFERENCES = ("brute", "exact", "embree")


@dataclass(frozen=True)
class Options:
    """What is measured. size: width and height of the view; check_rays: rays per set compared with the reference.
    own_rays: the same for the scene's own ray sets, None for all of them.

    threads: for builds and tracing. seed: of the rays. curve: samples per pixel of the pictures. offsets: how far away
    the grid of touching boxes is put. scaling: whether views of fewer pixels are timed. peak: whether each build is
    done once more in a process of its own, for its memory. maps: whether what each pixel costs is kept. pass_seconds:
    how long one timed pass may take.
    memory_limit: bytes that a build may take, None for what the native module allows; a configuration that needs more
    gives a row whose `error` says so.
    """

    size: tuple[int, int] = (1024, 1024)
    sets: tuple[str, ...] = rays.NAMES
    repeats: int = 7
    threads: int = 1
    reference: str = "brute"
    check_rays: int = 20_000
    own_rays: int | None = None
    seed: int = 1
    curve: tuple[int, ...] = ()
    offsets: tuple[float, ...] = ()
    scaling: bool = False
    peak: bool = False
    maps: bool = False
    pass_seconds: float = PASS_SECONDS
    memory_limit: int | None = None

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


@dataclass(eq=False)
class Prepared:
    """The rays of a scene, what the reference answers to those that are checked, and what else all structures share.

    beside: the tree that keeps time for pictures, None where there are none or it is too large to be kept.
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
    beside: Structure | None = None


def check_room(native: Native, options: Options) -> None:
    """Raise MemoryError where there is no room for the rays of a view of this size."""
    width, height = options.size
    room.check(native, f"the rays of {width}x{height} pixels", rays.bytes_needed(options.size, options.sets))


def prepare(native: Native, workload: Workload, options: Options) -> Generator[Progress, None, Prepared]:
    """The part of the work that all configurations of a scene share; a generator that returns it.

    Raises MemoryError, before anything is made, where there is no room for it.
    """
    check_room(native, options)
    yield Progress(0.0, "making the rays")
    tracer = _tracer(native, workload, options)
    ray_sets = rays.make(workload, tracer, size=options.size, seed=options.seed, names=options.sets)
    checked = {}
    for rays_of_set in ray_sets:
        own = len(rays_of_set) if options.own_rays is None else options.own_rays
        wanted = own if rays_of_set in workload.extra else options.check_rays
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
    made = Prepared(workload, options, ray_sets, checked, expected, views, pictures, moved)
    if pictures is not None and tracer.statistics["bytes"] <= KEPT_BYTES:
        made.beside = tracer
    if options.maps:
        width, height = (_scaled(side, options.size) for side in options.size)
        made.map_size = costmap.rounded((width, height))
        (made.map_view,) = rays.make(workload, tracer, size=made.map_size, seed=options.seed, names=("primary",))[:1]
    return made


def _scaled(side: int, size: tuple[int, int]) -> int:
    """A side of the view in pixels of a map."""
    return round(side * MAP_SIDE / max(size))


def prepared(native: Native, workload: Workload, options: Options) -> Prepared:
    """The same at one go, for whoever shows no progress."""
    steps = prepare(native, workload, options)
    while True:
        try:
            next(steps)
        except StopIteration as end:
            found: Prepared = end.value
            return found


TRACERS = ("kd", "bvh-sah")
"""What finds the hits from which rays go on, the quickest first; the second needs half the memory."""


def _tracer(native: Native, workload: Workload, options: Options) -> Structure:
    """The quickest structure for which there is room. Raises MemoryError when there is none for any."""
    ids = {row["id"] for row in native.structures()}
    *others, last = [spec for spec in TRACERS if spec in ids] or ["brute"]
    build = partial(native.build, workload.vertices, workload.triangles, threads=0, memory_limit=options.memory_limit)
    for spec in others:
        with contextlib.suppress(MemoryError):
            return build(spec)
    return build(last)


def _smaller_views(workload: Workload, tracer: Tracer, options: Options) -> Iterator[RaySet]:
    """The primary rays of the same view in fewer pixels, the fewest first."""
    across, down = options.size
    least = rays.TILE
    sizes = [(max(least, across // n // least * least), max(least, down // n // least * least)) for n in SCALING]
    for width, height in dict.fromkeys(sizes):
        (view,) = rays.make(workload, tracer, size=(width, height), seed=options.seed, names=("primary",))[:1]
        yield view


def _reference(native: Native, workload: Workload, checked: dict[str, RaySet], options: Options) -> dict[str, Answers]:
    """What the reference answers to the checked rays of each set, on all cores."""
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
