# SPDX-License-Identifier: GPL-3.0-or-later
"""Error against run time: pictures with growing sample counts, compared with a converged one.

For one sampler and seed all structures must render the same picture, so the error depends on the samples only and the
time on the structure; the equality of the pictures is checked.

A sample that sees the sun in a curved mirror is ten thousand times as bright as its neighbours, so that without limits
ten pixels of a picture hold nine tenths of its squared error and more samples do not lower it. All pictures and their
reference therefore limit what one sample may add (`LIMITS`): they converge to the same limited picture, and the share
of light that the limits remove is measured and reported. No pixel is left out of an error.

Errors are expectations over several pictures of independent seeds, with the interval that their variance gives (Celarek
et al. 2019, "Quantifying the error of light transport algorithms"). They do not contain the noise of the reference: it
has two independent halves, and the product of the differences from both has the squared error as its expectation.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NotRequired, TypedDict

import numpy as np
from numpy.typing import NDArray

from ..base import picture_files, rotation
from ..scene.rays import TILE
from ..scene.workload import Peer, View, Workload
from ..session.session import render_scene
from . import flip, inference, timing
from .two_level import TwoLevel

if TYPE_CHECKING:
    from ..base.interface import Native, RenderJob, RenderScene, Structure
    from .two_level import AnyLayout

SIZE = 512
"""Shorter side of the pictures in pixels."""

SMALL = 96
"""Shorter side of the pictures that are repeated in rounds, and of those with independent samples."""

CONVERGED = 4
"""Samples of the reference as a multiple of the largest sample count; it uses two other seeds, half of them each."""

SEEDS = 4
"""Pictures of each sample count whose mean error is reported; only the first is timed."""

SECONDS = 120.0
"""Limit on the pictures of a scene: a half for those that all structures share, a quarter for the structures together,
a quarter for the other renderer.
"""

SHARED, OF_THE_PEER = 0.5, 0.25
"""These parts of it."""

MOST_SAMPLES = (1 << 24) // 16
"""Largest sample count of a curve, so that its reference stays renderable (2^24 samples)."""

LIMITS = {"clamp_direct": 10.0, "clamp_indirect": 10.0}
"""Largest radiance that a sample adds with its first reflection and after it; white is 1. Cycles limits the latter by
default and to the same value.
"""

UNLIMITED_SHARE = 8
"""Divisor of the reference's samples for the pictures that measure the light which the limits remove."""

RELATIVE_FLOOR = 1e-2
"""Added to the squared reference in relMSE, so that black pixels do not dominate (Rousselle et al. 2011)."""

IMAGE_PIXELS, IMAGE_SAMPLES = 1024 * 1024, 16
"""Pixels and samples of the picture whose time, build included, is reported for each structure."""

INDEPENDENT = 64
"""Number of one-sample pictures whose means give the errors of independent samples; their reference has twice as many
in each half.
"""

SLOPE, SLOPE_WITHIN = -0.5, 0.05
"""Theoretical slope of log RMSE over log samples for independent samples, and the tolerance of a fit
over few pictures.
"""

PORTRAIT, PORTRAIT_SAMPLES = 480, 16
"""Longer side in pixels and samples of the picture that shows the scene in a report."""

POINT_SECONDS = 10.0
"""Limit on the expected seconds of one picture; slower ones are left out."""

RAYS_PER_SAMPLE = 8
"""Rays per camera sample for that estimate; measured: 4 to 9 on the test scenes."""

Image = NDArray[np.float32]


class Converged(TypedDict):
    """The reference picture. samples: per pixel. rmse: its own, estimated from the difference of its halves. limits: on
    what a sample adds. removed: the share of light that they remove. points: errors of the pictures of each sample
    count, the same for all structures, with the ends of their 95 % intervals. left_out: sample counts that would have
    taken more than `seconds`. peer: its difference from the other renderer's, relative to the mean, or why there is
    none.
    """

    samples: int
    rmse: float
    limits: dict[str, float]
    removed: float
    size: list[int]
    points: list[dict[str, Any]]
    left_out: list[int]
    seconds: float | None
    peer: NotRequired[float | str]


class Curve:
    """The pictures of one scene. size: width and height of its view, which sets their aspect ratio."""

    def __init__(
        self,
        native: Native,
        workload: Workload,
        size: tuple[int, int],
        samples: tuple[int, ...],
        seed: int,
        max_bounces: int = 4,
        seconds: float = math.inf,
    ):
        """seconds: limit on the time of all pictures (SECONDS)."""
        self._native = native
        self._workload = workload
        self.samples = samples
        self._seconds = seconds
        self._size = _scaled(size, SIZE)
        self._small = _scaled(size, min(SMALL, SIZE))
        aspect = self._size[0] / self._size[1]
        self._camera = workload.render_camera or plain_camera(workload.view, aspect, workload.diagonal())
        self._seed = seed
        self._max_bounces = max_bounces
        self._halves: tuple[Image, Image] | None = None
        self.converged: Converged | None = None
        self.peer: list[dict[str, float | None]] = []
        self._pictures: dict[tuple[tuple[int, int], int], Image] = {}
        self.independent: list[dict[str, float]] = []

    def converge(self, structure: Structure) -> None:
        """Render on all cores what all structures share: the converged picture, the pictures of each sample count, and
        those of independent samples. Counts that do not fit into the limit are left out.
        """
        kept = self._affordable_counts(structure)
        left_out, self.samples = [n for n in self.samples if n not in kept], kept
        half = max(1, kept[-1] * CONVERGED // 2)
        first, second = (self._image(self._render(structure, half, seed, 0)) for seed in self._reference_seeds())
        self._halves = first, second
        self.converged = {
            "samples": 2 * half,
            "rmse": errors(first, second)["rmse"] / 2,
            "limits": dict(LIMITS),
            "removed": self._removed(structure, max(1, half // UNLIMITED_SHARE)),
            "size": list(self._size),
            "points": [self._expected(structure, samples) for samples in kept],
            "left_out": left_out,
            "seconds": None if math.isinf(self._seconds) else self._seconds,
        }
        self.independent = list(self._independent(structure))

    def _affordable_counts(self, structure: Structure) -> tuple[int, ...]:
        """The sample counts whose pictures, and the converged one, take no longer than the limit; at least one."""
        if math.isinf(self._seconds):
            return self.samples
        begun = time.perf_counter()
        self._render(structure, 1, self._seed, 0)
        each = time.perf_counter() - begun
        return fitting(self.samples, each, SHARED * self._seconds)

    def _expected(self, structure: Structure, samples: int) -> dict[str, Any]:
        """The mean errors of the pictures of some samples, with intervals; keeps the first picture."""
        found = []
        for number in range(SEEDS):
            seed = self._seed if number == 0 else self._seed + INDEPENDENT + 4 + number
            picture = self._image(self._render(structure, samples, seed, 0))
            if number == 0:
                self._pictures[self._size, samples] = picture
            found.append(self._errors(picture))
        first = self._pictures[self._size, samples]
        shape = self._size[1], self._size[0], 3
        return {"spp": samples, **expected(found), "flip": flip.mean(first.reshape(shape), self._mean().reshape(shape))}

    def _errors(self, picture: Image) -> dict[str, float]:
        """Squared errors of a picture."""
        assert self._halves is not None, "the reference comes first"
        return squared_errors(picture, *self._halves)

    def _mean(self) -> Image:
        """The converged picture."""
        assert self._halves is not None, "the reference comes first"
        return np.mean(self._halves, axis=0, dtype=np.float64).astype(np.float32)

    def _reference_seeds(self) -> tuple[int, int]:
        """Seeds that no other picture uses: those of independent samples follow the picture's own."""
        return self._seed + INDEPENDENT + 2, self._seed + INDEPENDENT + 3

    def _removed(self, structure: Structure, samples: int) -> float:
        """The share of all light that the limits remove, from two pictures of the same random numbers."""
        scene, seed = self._scene(structure), self._seed + INDEPENDENT + 4
        limited, whole = (
            float(np.nan_to_num(self._image(self._job(scene, samples, seed, 0, limits=limits))).mean(dtype=np.float64))
            for limits in (LIMITS, {})
        )
        return 1.0 - limited / whole if whole > 0 else 0.0

    def portrait(self, structure: Structure) -> bytes:
        """A PNG of the scene with more samples than the pictures that are compared."""
        scale = PORTRAIT / max(self._size)
        size = max(TILE, round(scale * self._size[0])), max(TILE, round(scale * self._size[1]))
        job = self._job(self._scene(structure), PORTRAIT_SAMPLES, self._seed, 0, size=size)
        return picture_files.encoded(self._image(job, size).reshape(size[1], size[0], 3))

    def meet(self, peer: Peer, threads: int) -> None:
        """Render pairs of pictures of each sample count with another renderer, as far as time allows.

        Its error is that about its own mean: half the mean squared difference of a pair. The difference between the two
        renderers' means is measured apart, as models may differ.
        """
        assert self._halves is not None, "the reference comes first"
        assert self.converged is not None, "the reference comes first"
        weights = 3.0 / (self._mean().astype(np.float64) ** 2 + RELATIVE_FLOOR).reshape(-1, 3)
        left, last = OF_THE_PEER * self._seconds, 0.0
        for samples in self.samples:
            if last * 2 > left:
                break
            pair, begun = [], time.perf_counter()
            for seed in range(2):
                picture, seconds = peer.render(
                    self._size, samples, self._seed + seed, self._max_bounces, LIMITS, threads
                )
                pair.append((np.nan_to_num(picture.reshape(-1, 3).astype(np.float64)), seconds))
            last = time.perf_counter() - begun
            left -= last
            (first, taken), (second, again) = pair
            square = (first - second) ** 2 / 2
            self.peer.append(
                {
                    "spp": samples,
                    "seconds": (taken + again) / 2,
                    "rmse": float(np.sqrt(square.mean())),
                    "relmse": float((square * weights).mean() / 3),
                }
            )
            apart = float(((first - self._halves[0]) * (second - self._halves[1])).mean())
            self.converged["peer"] = math.sqrt(max(apart, 0.0)) / max(float(self._mean().mean()), 1e-30)

    def _independent(self, structure: Structure) -> Iterator[dict[str, float]]:
        """The errors of means of one-sample pictures with different seeds.

        The samples within one picture are stratified, so its error falls faster than that of independent ones; these
        show by how much, and that stratification alone is the cause.
        """
        seeds = range(self._seed + 1, self._seed + 1 + INDEPENDENT)
        pictures, halves = (
            [self._image(self._render(structure, n, seed, 0, self._small), self._small) for seed in some]
            for n, some in ((1, seeds), (INDEPENDENT, self._reference_seeds()))
        )
        # Use the same pictures at every sample count.
        yield from of_independent(pictures, (halves[0], halves[1]), [n for n in self.samples if n <= INDEPENDENT])

    def finer(self, samples: int) -> tuple[int, int, int]:
        """Width, height and samples per pixel of a picture with about as many rays as `samples` take here, but more
        pixels.

        Rays of neighbouring pixels lie closer together in it, though seldom as close as in a picture of IMAGE_PIXELS.
        Coherence changes the time of some traversals by a factor of two and more, and with it the ranking of the
        structures.
        """
        pixels = self._small[0] * self._small[1]
        more = max(1, min(samples, IMAGE_PIXELS // pixels))
        width, height = (round(side * math.sqrt(more)) for side in self._small)
        return width, height, max(1, samples // more)

    def whole(self, seconds: float, samples: int) -> float:
        """Predicted seconds of a picture of IMAGE_PIXELS with IMAGE_SAMPLES, from the time of a picture
        of this size.
        """
        return seconds / (self._size[0] * self._size[1] * samples) * IMAGE_PIXELS * IMAGE_SAMPLES

    def affordable(self, mrays_s: float) -> list[int]:
        """The sample counts that a structure of this speed renders within POINT_SECONDS."""
        pixels = self._size[0] * self._size[1]
        return [n for n in self.samples if pixels * n * RAYS_PER_SAMPLE / (mrays_s * 1e6) <= POINT_SECONDS]

    def rays(self, samples: int) -> int:
        """Estimated number of rays of a small picture."""
        return self._small[0] * self._small[1] * samples * RAYS_PER_SAMPLE

    def share(self, structures: int) -> float:
        """Seconds for the pictures of each structure, of a number of structures."""
        return (1 - SHARED - OF_THE_PEER) * self._seconds / max(structures, 1)

    def point(self, structure: AnyLayout, samples: int, threads: int) -> tuple[dict[str, Any], int]:
        """Errors and seconds of one picture, and the number of its pixels that differ from the shared picture's."""
        assert self.converged is not None, "the reference comes first"
        _, seconds, differing = self._made(structure, samples, threads)
        found = next(point for point in self.converged["points"] if point["spp"] == samples)
        return {**found, "seconds": seconds}, differing

    def timed(self, structure: AnyLayout, samples: int, threads: int) -> tuple[float, int]:
        """Seconds of the reported picture, predicted by `finer`, and the number of pixels that differ from other
        structures'.
        """
        width, height, fewer = self.finer(samples)
        _, seconds, differing = self._made(structure, fewer, threads, (width, height))
        return seconds / (width * height * fewer) * IMAGE_PIXELS * IMAGE_SAMPLES, differing

    def _made(
        self, structure: AnyLayout, samples: int, threads: int, size: tuple[int, int] | None = None
    ) -> tuple[Image, float, int]:
        """A picture, its seconds, and the number of pixels that differ from the first structure's."""
        scene = self._scene(structure)
        now = timing.clock(threads)
        start = now()
        job = self._job(scene, samples, self._seed, threads, size=size)
        # One thread: processor time, as in all other measurements. Several: the native module's time, without polling.
        seconds = now() - start if threads == 1 else float(job.statistics["seconds"])
        picture = self._image(job, size)
        first = self._pictures.setdefault((size or self._size, samples), picture)
        differing = int((picture.view(np.uint32) != first.view(np.uint32)).any(axis=1).sum())
        return picture, max(seconds, 1e-9), differing

    def rays_per_sample(self, structure: Structure, samples: int) -> dict[str, float]:
        """Mean number of primary, shadow and secondary rays per camera sample of a small picture."""
        counted = self._render(structure, samples, self._seed, 0, self._small).statistics
        pixels = self._small[0] * self._small[1] * samples
        return {
            "primary": counted["rays_primary"] / pixels,
            "shadow": counted["rays_shadow"] / pixels,
            "secondary": counted["rays_secondary"] / pixels,
        }

    def _render(
        self, structure: Structure, samples: int, seed: int, threads: int, size: tuple[int, int] | None = None
    ) -> RenderJob:
        return self._job(self._scene(structure), samples, seed, threads, size=size)

    def _scene(self, structure: AnyLayout) -> RenderScene:
        """The scene with this structure. Textures are copied here, outside all timed code."""
        if isinstance(structure, TwoLevel):
            assert self._workload.kept is not None, "it was built from it"
            return render_scene(self._native, structure.instances, self._workload.kept)
        scene = self._workload.render_scene
        if scene is None:
            return self._native.RenderScene(structure, **plain_scene())
        return render_scene(self._native, structure, scene)

    def _job(
        self,
        render_scene: RenderScene,
        samples: int,
        seed: int,
        threads: int,
        *,
        size: tuple[int, int] | None = None,
        limits: Mapping[str, float] | None = None,
    ) -> RenderJob:
        """Render and wait for the end. Raises RuntimeError with the job's error."""
        width, height = size or self._size
        settings = {
            "width": width,
            "height": height,
            "samples": samples,
            "max_bounces": self._max_bounces,
            "seed": seed,
            **(LIMITS if limits is None else limits),
        }
        camera = self._camera if isinstance(self._camera, dict) else self._camera.as_dict()
        job = self._native.render(render_scene, camera, settings, threads=threads)
        while not job.wait(100):
            pass
        if job.error is not None:
            raise RuntimeError(job.error)
        return job

    def _image(self, job: RenderJob, size: tuple[int, int] | None = None) -> Image:
        """(pixels, 3) float32 linear RGB of a finished job."""
        width, height = size or self._size
        out = np.zeros(width * height * job.passes["Combined"], np.float32)
        job.copy_into("Combined", out)
        return np.ascontiguousarray(out.reshape(width * height, -1)[:, :3])


def _scaled(size: tuple[int, int], least: int) -> tuple[int, int]:
    """The size in pixels with the aspect ratio of `size` whose shorter side is `least`."""
    scale = least / min(size)
    width, height = (max(TILE, round(side * scale)) for side in size)
    return width, height


def fitting(counts: Sequence[int], each: float, seconds: float) -> tuple[int, ...]:
    """The sample counts, from the least, whose SEEDS pictures each and converged picture take no longer than this, each
    sample per pixel taking `each`; at least the first.
    """
    kept = 1
    for number in range(1, len(counts) + 1):
        if each * (SEEDS * sum(counts[:number]) + CONVERGED * counts[number - 1]) <= seconds:
            kept = number
    return tuple(counts[:kept])


def errors(picture: Image, reference: Image) -> dict[str, float]:
    """RMSE and relMSE of linear RGB over all pixels, and the number of pixels with non-finite values, which count as
    black.
    """
    found = squared_errors(picture, reference, reference)
    return {"rmse": math.sqrt(found["mse"]), "relmse": found["relmse"], "not_finite": int(found["not_finite"])}


def squared_errors(picture: Image, first: Image, second: Image) -> dict[str, float]:
    """The mean squared error, absolute and relative, of a picture against a reference of two halves, and the number of
    pixels that are not finite. With independent halves neither contains the noise of the reference, and may be negative
    where the error is smaller than that.
    """
    finite = np.isfinite(picture).all(axis=1)
    shown = np.where(finite[:, None], picture, np.float32(0.0)).astype(np.float64)
    one, other = first.astype(np.float64), second.astype(np.float64)
    difference = (shown - one) * (shown - other)
    relative = difference / (((one + other) / 2) ** 2 + RELATIVE_FLOOR)
    return {
        "mse": float(difference.mean()) if difference.size else 0.0,
        "relmse": float(relative.mean()) if difference.size else 0.0,
        "not_finite": float((~finite).sum()),
    }


def expected(found: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    """RMSE and relMSE of the mean of squared errors of independent pictures, with the ends of their 95 % intervals by
    Student's distribution, and the pixels of the first that are not finite.
    """
    shown: dict[str, Any] = {"not_finite": int(found[0]["not_finite"])}
    for key, name, power in (("mse", "rmse", 0.5), ("relmse", "relmse", 1.0)):
        values = np.array([one[key] for one in found])
        mean, half = max(float(values.mean()), 0.0), 0.0
        if len(values) > 1:
            reach = inference.student_quantile(inference.CONFIDENCE, len(values) - 1)
            half = reach * float(values.std(ddof=1)) / math.sqrt(len(values))
        shown[name] = mean**power
        shown[f"{name}_95"] = [max(mean - half, 0.0) ** power, (mean + half) ** power]
    return shown


def slope(points: Sequence[Mapping[str, float]], error: str = "rmse") -> float:
    """Slope of log error over log samples, by least squares; −0.5 for RMSE of independent samples.

    NaN if an error is 0, as in a picture without noise, or with fewer than two points.
    """
    if len(points) < 2 or not all(point[error] > 0 for point in points):
        return math.nan
    x, y = (np.log([point[key] for point in points]) for key in ("spp", error))
    return float(np.polyfit(x, y, 1)[0])


def is_right(fitted: float) -> bool:
    """Whether the slope of independent samples matches the theory."""
    return abs(fitted - SLOPE) <= SLOPE_WITHIN


def judged(fitted: float) -> str:
    """The same as text."""
    return f"{SLOPE:.2f} ± {SLOPE_WITHIN:g} {'holds' if is_right(fitted) else 'does not hold'}".replace("-", "−")


def of_independent(
    pictures: Sequence[Image], reference: tuple[Image, Image] | Image, counts: Iterable[int]
) -> Iterator[dict[str, float]]:
    """The errors of means of `count` pictures each, averaged over disjoint groups; every picture is used at each count.

    The few pixels with large errors thus weigh the same at every count and do not tilt the line. pictures: (pixels, 3)
    linear RGB, one sample per pixel, each with its own seed. reference: one picture, or two independent halves.
    """
    halves = reference if isinstance(reference, tuple) else (reference, reference)
    for count in counts:
        starts = range(0, len(pictures) - count + 1, count)
        means = (np.mean(pictures[start : start + count], axis=0, dtype=np.float64) for start in starts)
        found = [squared_errors(mean.astype(np.float32), *halves) for mean in means]
        yield {
            "spp": count,
            "rmse": math.sqrt(max(float(np.mean([one["mse"] for one in found])), 0.0)),
            "relmse": max(float(np.mean([one["relmse"] for one in found])), 0.0),
            "not_finite": int(max(one["not_finite"] for one in found)),
        }


def plain_camera(view: View, aspect: float, diagonal: float) -> dict[str, Any]:
    """The native renderer's camera of a view. aspect: width by height. diagonal: of the scene's box."""
    right, up, forward = view.axes()
    to_world = np.eye(4)
    to_world[:3, :4] = np.stack([right, up, -forward, view.eye], axis=1)
    # A scene may be a single point, or small and far away.
    reach = max(diagonal, float(np.linalg.norm(view.target - view.eye)))
    return {
        "kind": "perspective",
        "to_world": to_world,
        "window": view.window(aspect),
        "clip_start": 1e-6 * diagonal,
        "clip_end": 1e3 * reach,
    }


def plain_scene() -> dict[str, Any]:
    """Light grey diffuse surfaces under a bright sky, for files without materials."""
    return {
        "materials": [{"name": "Matt", "base_color": (0.7, 0.7, 0.7), "specular": 0.0}],
        "lights": [{"kind": "sun", "to_world": _tilted(), "power": (2.0, 2.0, 2.0), "angle": 0.1}],
        "world": {"color": (0.6, 0.7, 0.8)},
    }


def _tilted() -> NDArray[np.float64]:
    """Transform of a sun that shines down at an angle."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.tilt(np.radians(35.0), np.radians(25.0))
    return matrix
