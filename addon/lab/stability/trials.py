# SPDX-License-Identifier: GPL-3.0-or-later
"""Unlimited numbered small scenes with rays likely to be answered wrongly, for runs of billions of rays.

Trial `number` of seed `seed` always has the same scene and rays, so a run can be stopped, resumed and distributed.
Every eighth trial is one of the extreme cases with its own rays and new ones; the others are random scenes of ten to
three hundred triangles.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...core.base.arrays import F32, I32
from ...core.measure import accuracy
from ...core.measure.accuracy import Answers
from . import stability
from .leaks import icosphere
from .stability import TILE, Row

if TYPE_CHECKING:
    from ...core.base.interface import Case, Native

Rays = tuple[F32, F32, F32, F32]
"""origins (n, 3), directions (n, 3), t_min (n,), t_max (n,)."""

MANY, FEW, FEWEST = 16_384, 2048, 256
"""Rays of a trial, in whole tiles; few where many need the exact predicate."""

CASES_PER_SEED = 60
"""Number of extreme cases tried before those of the next seed."""

EXACT_PAIRS = 3_000_000
"""Number of ray-triangle pairs per trial that exact arithmetic decides."""

VERSION = 4
"""Version of the trials: increment when a number's scene or a row's content changes; older runs are not continued."""

BLOCK = 64
"""Number of trials whose sums are kept together."""

Random = np.random.Generator


def trial(native: Native, specs: Sequence[str], seed: int, number: int, *, threads: int = 1) -> list[Row]:
    """One row per configuration, as of `stability.measure_case`; the case is the kind of scene.

    Every ray is traced for its nearest hit, every fourth tile also for any hit; shadow methods, which do not affect
    nearest hits, are traced for any hit of every ray. Brute force answers all rays, exact arithmetic an evenly spaced
    sample, and every structure is compared with both.
    """
    # Compute both references.
    random = np.random.default_rng([seed, number])
    name, vertices, triangles, rays = _scene(native, seed, number, random)
    count, apart = len(rays[0]), stability.different(*rays)
    brute = Answers.of(native.build(vertices, triangles, "brute", threads=1).closest(*rays, threads=threads))
    wanted = min(count, EXACT_PAIRS // max(1, len(triangles)))
    sample = np.unique(np.linspace(0, count - 1, wanted).astype(np.int64))
    exact = Answers.of(native.exact_closest(vertices, triangles, *(part[sample] for part in rays), threads=threads))
    beside = accuracy.compare(exact, brute.take(sample), None, native.ulp_distance, bitwise=True)
    quarter = np.arange(count) // TILE % 4 == number % 4
    rows = []
    # Compare each configuration; equal answers, the common case, skip the detailed comparison.
    for spec in specs:
        structure = native.build(vertices, triangles, spec, threads=1)
        errors, own = accuracy.Errors(rays=count), beside
        shadows = stability.only_shadows(spec)
        asked = np.ones(count, bool) if shadows else quarter
        if not shadows:
            answers = stability.nearest(structure, rays, threads=threads)
            if not same(answers, brute):
                errors = accuracy.compare(brute, answers, None, native.ulp_distance, bitwise=True)
                own = accuracy.compare(exact, answers.take(sample), None, native.ulp_distance, bitwise=True)
        occluded = structure.occluded(*(part[asked] for part in rays), threads=threads)
        if shadows:
            own = accuracy.compare(exact, None, occluded[sample], native.ulp_distance, bitwise=True)
        about = {"case": name, "spec": spec, "triangles": len(triangles), "different_rays": apart}
        row = {**about, **stability.columns(errors, own)}
        row["wrong_any_hit"] += int((occluded != brute.hit[asked]).sum())
        rows.append(row)
    return rows


def block(native: Native, specs: Sequence[str], seed: int, number: int, *, threads: int = 1) -> list[Row]:
    """The sums of `BLOCK` trials, one row per configuration; `wrong_in` lists the trials with a difference."""
    totals: dict[str, Row] = {}
    for n in range(number * BLOCK, (number + 1) * BLOCK):
        for row in trial(native, specs, seed, n, threads=threads):
            spec = row["spec"]
            found = [*totals[spec]["wrong_in"]] if spec in totals else []
            totals[spec] = stability.add(totals.get(spec), row)
            totals[spec]["wrong_in"] = found + [n] * stability.differs(row)
    return list(totals.values())


def same(a: Answers, b: Answers) -> bool:
    """Whether two sets of answers are bitwise equal."""
    return all(
        np.array_equal(x.view(np.uint32), y.view(np.uint32))
        for x, y in ((a.t, b.t), (a.triangle, b.triangle), (a.u, b.u), (a.v, b.v))
    )


def _scene(native: Native, seed: int, number: int, random: Random) -> tuple[str, F32, I32, Rays]:
    """Kind, vertices, triangles and rays of a trial."""
    turn, place = divmod(number, 8)
    if place == 7:
        cases = extreme_cases(native, seed + turn // CASES_PER_SEED)
        case = cases[turn % len(cases)]
        vertices, triangles = case["vertices"], case["triangles"].astype(np.int32)
        own = case["origins"], case["directions"], case["t_min"], case["t_max"]
        chosen = random.permutation(len(own[0]))[: FEW // 2]
        more = rays_at(vertices, triangles, FEW - len(chosen), random)
        rays = tuple(np.concatenate([a[chosen], b]) for a, b in zip(own, more, strict=True))
        return case["name"], vertices, triangles, rays  # type: ignore[return-value]
    name, make, count = SORTS[(2 * turn + place - 5) % len(SORTS) if place in (5, 6) else 0]
    with np.errstate(over="ignore", invalid="ignore"):
        corners = make(int(random.integers(10, 300)), random).astype(np.float32)
    triangles = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    return name, corners, triangles, rays_at(corners, triangles, count, random)


@functools.lru_cache(maxsize=1)
def extreme_cases(native: Native, seed: int) -> list[Case]:
    """The small variants of a seed's extreme cases."""
    return native.cases("small", seed=seed)


def _soup(count: int, random: Random) -> NDArray[Any]:
    """Triangles of one size at random places, scaled and far from the origin at random."""
    size = 10.0 ** random.uniform(-3, 0.3)
    corners = random.uniform(-1, 1, (count, 1, 3)) + size * random.uniform(-1, 1, (count, 3, 3))
    scale, offset = 2.0 ** random.integers(-20, 20), random.choice([0, 0, 1, 100, 1e5])
    return np.asarray(scale * (corners + offset * random.uniform(-1, 1, 3))).reshape(-1, 3)


def _lattice(count: int, random: Random) -> NDArray[Any]:
    """Triangles with corners on a lattice."""
    return np.asarray(random.integers(-4, 5, (3 * count, 3)) / random.choice([1, 2, 8]))


def _walls(count: int, random: Random) -> NDArray[Any]:
    """Triangles in axis-aligned planes of a lattice."""
    corners = random.integers(0, 5, (count, 3, 3)).astype(np.float64)
    axis = random.integers(0, 3, count)
    corners[np.arange(count), :, axis] = corners[np.arange(count), :1, axis]
    return corners.reshape(-1, 3)


def _slivers(count: int, random: Random) -> NDArray[Any]:
    """Triangles with one very short edge."""
    first = random.uniform(-1, 1, (count, 1, 3))
    long, thin = random.uniform(-1, 1, (2, count, 1, 3))
    thin *= 10.0 ** random.uniform(-9, -3, (count, 1, 1))
    return np.concatenate([first, first + long, first + thin], axis=1).reshape(-1, 3)


def _any_exponent(count: int, random: Random) -> NDArray[Any]:
    """Triangles with corners of widely varying exponents."""
    powers = random.integers(-100, 60, (count, 1, 1)) + random.integers(-3, 4, (count, 3, 3))
    return (random.uniform(-1, 1, (count, 3, 3)) * 2.0**powers).reshape(-1, 3)


def _nudged(count: int, random: Random) -> NDArray[Any]:
    """Triangles between eight points, some corners moved by one float."""
    few = random.uniform(-1, 1, (8, 3)).astype(np.float32)
    corners = few[random.integers(0, 8, 3 * count)]
    away = random.choice([-1, 0, 0, 0, 1], corners.shape).astype(np.float32)
    return np.asarray(np.nextafter(corners, corners + away))


def _closed(count: int, random: Random) -> NDArray[Any]:
    """A closed bumpy sphere, at the origin or away from it."""
    vertices, triangles = icosphere(int(count > 100))
    vertices = vertices * (1 + 0.3 * np.sin(random.uniform(1, 9, 3) * vertices).sum(axis=1, keepdims=True))
    return (vertices + random.choice([0.0, 10.0, 1e4]))[triangles].reshape(-1, 3)


def _boxes(count: int, random: Random) -> NDArray[Any]:
    """Touching boxes on a lattice, half of the time rotated."""
    low = random.integers(0, 4, (max(1, count // 12), 3)).astype(np.float64)
    unit = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)], np.float64)
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    halves = np.array([[s[i] for i in half] for s in sides for half in ((0, 1, 2), (0, 2, 3))])
    corners = (low[:, None] + unit[None])[:, halves].reshape(-1, 3)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0] if random.integers(2) else np.eye(3)
    return np.asarray(corners @ turn)


def _sizes_away(count: int, random: Random) -> NDArray[Any]:
    """Clusters of triangles, each from a tenth to 10^7 of its sizes away from the origin and from the others."""
    units = 10.0 ** -random.integers(-1, 8, 5)
    at = random.uniform(-1, 1, (5, 3))
    own = random.integers(0, 5, count)
    corners = random.uniform(-1, 1, (count, 1, 3)) + 0.5 * random.uniform(-1, 1, (count, 3, 3))
    return np.asarray(at[own][:, None] + units[own][:, None, None] * corners).reshape(-1, 3)


SORTS: tuple[tuple[str, Callable[[int, Random], NDArray[Any]], int], ...] = (
    ("random: soup", _soup, MANY),
    ("random: whole numbers", _lattice, MANY),
    ("random: walls along the axes", _walls, MANY),
    ("random: slivers", _slivers, MANY),
    ("random: any exponent", _any_exponent, FEWEST),
    ("random: one float apart", _nudged, FEW),
    ("random: closed surface", _closed, MANY),
    ("random: touching boxes", _boxes, MANY),
    ("random: sizes away", _sizes_away, MANY),
)
"""Kinds of random scenes: name, generator of (3 n, 3) corners of about n triangles, and number of rays."""


def rays_at(vertices: F32, triangles: I32, count: int, random: Random) -> Rays:
    """Rays that provoke errors in a scene: at corners, edges and surfaces, along axes, with extreme lengths."""
    corners = vertices[triangles.reshape(-1)].reshape(-1, 3, 3)
    corners = corners[np.isfinite(corners).all(axis=(1, 2))]
    if not len(corners):
        corners = np.zeros((1, 3, 3), np.float32)
    low, high = corners.min(axis=(0, 1)).astype(np.float64), corners.max(axis=(0, 1)).astype(np.float64)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, 1e-30)

    # Points of six kinds on and around the triangles.
    def point() -> NDArray[Any]:
        chosen = corners[random.integers(0, len(corners), count)].astype(np.float64)
        weights = random.dirichlet([1, 1, 1], count)
        inside = (weights[:, :, None] * chosen).sum(axis=1)
        anywhere = middle + half * random.uniform(-1.5, 1.5, (count, 3))
        kinds = [chosen[:, 0], (chosen[:, 0] + chosen[:, 1]) / 2, inside, anywhere, np.rint(anywhere)]
        return np.choose(random.integers(0, len(kinds), count)[:, None], kinds)

    # Origins up to 10^7 sizes of a triangle away from it, where weights need most digits.
    def afar() -> NDArray[Any]:
        chosen = corners[random.integers(0, len(corners), count)].astype(np.float64)
        size = np.abs(chosen - chosen[:, :1]).max(axis=(1, 2))[:, None]
        return chosen[:, 0] + size * 10.0 ** random.uniform(-1, 7, (count, 1)) * random.uniform(-1, 1, (count, 3))

    # Directions to points, random, along axes, and with single components scaled towards underflow.
    with np.errstate(all="ignore"):
        origins = np.where(random.random((count, 1)) < 0.125, afar(), point()).astype(np.float32)
        to_point = point().astype(np.float32) - origins
        any_way = random.normal(size=(count, 3)) * half.max()
        along = random.choice([-1.0, 0.0, -0.0, 1.0], (count, 3)) * half.max()
        slow = np.where(
            random.random((count, 3)) < 0.5, to_point * 2.0 ** random.integers(-149, -20, (count, 3)), to_point
        )
        kinds = [to_point, to_point, to_point, any_way, along, slow]
        directions = np.choose(random.integers(0, len(kinds), count)[:, None], kinds).astype(np.float32)
        stretched = directions * np.float32(2) ** random.integers(-60, 60, (count, 1)).astype(np.float32)
        directions = np.where(random.random((count, 1)) < 0.125, stretched, directions)
    # Replace rays that overflowed, then limit the interval of a quarter of them.
    broken = ~(np.isfinite(origins).all(axis=1) & np.isfinite(directions).all(axis=1))
    origins[broken], directions[broken] = 0, (1, 0, 0)
    t_min, t_max = np.zeros(count, np.float32), np.full(count, np.inf, np.float32)
    limited = random.random(count) < 0.25
    ends = np.array([0, 0.5, 1, np.nextafter(np.float32(1), np.float32(0)), np.nextafter(np.float32(1), np.float32(2))])
    t_max[limited] = random.choice(ends, int(limited.sum()))
    t_min[limited] = random.choice([0.0, 1e-6, 0.5, 1.0, -1.0], int(limited.sum()))
    _in_tiles(origins, directions, t_min, t_max, random)
    return origins, directions, t_min, t_max


def _in_tiles(origins: F32, directions: F32, t_min: F32, t_max: F32, random: Random) -> None:
    """Turn every fourth tile into one of a picture, or of shadow rays to one light.

    Pictures are pinholes, from telescopes to nearly half of all directions, or parallel; half of them along the axes.
    Lights are points or suns; they are few, so that the last blocker is often the next.
    """
    count = len(origins) // TILE // 4
    x, y = (np.indices((8, 8)).reshape(2, TILE) / 3.5 - 1).astype(np.float32)
    last = slice(len(origins) - count * TILE, None)
    lights = origins[random.integers(0, len(origins), 4)]
    here, ways, ends = (part[last].reshape(count, TILE, -1) for part in (origins, directions, t_max))
    t_min[last] = 0
    # Choose a direction, axes across it and a window size for each tile.
    for o, d, end in zip(here, ways, ends, strict=True):
        with np.errstate(all="ignore"):
            towards, size = d[0].copy(), np.abs(d[0]).max()
            across = np.eye(3)[random.permutation(3)] if random.integers(2) else random.normal(size=(3, 3))
            window = size * 10.0 ** random.uniform(-7, 0.7) * (x[:, None] * across[0] + y[:, None] * across[1])
            kind = random.integers(4)
            end[:] = np.inf
            if kind == 0:
                o[:], d[:] = o[0], towards + window
            elif kind == 1:
                o[:], d[:] = o[0] + window, towards
            elif kind == 2:
                d[:] = towards
            else:
                d[:] = lights[random.integers(len(lights))] - o
                end[:] = 1
    broken = ~(np.isfinite(origins).all(axis=1) & np.isfinite(directions).all(axis=1))
    origins[broken], directions[broken] = 0, (1, 0, 0)
