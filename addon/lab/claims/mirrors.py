# SPDX-License-Identifier: GPL-3.0-or-later
"""Heckbert and Hanrahan 1984: the rays that flat polygons mirror and refract go as beams, like camera rays.

The paper gives no times against single rays; its text states that reflections in planes are linear transformations, and
so keep beams, and that refraction is one only approximately.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np

from ...core.base.arrays import F32
from ...core.scene.workload import Workload
from . import paper_scenes
from .claims import Checked, Claim, Lab, Outcome, verdict

PAPER = "Heckbert and Hanrahan 1984, Beam tracing polygonal objects"

SIZE = (640, 480)
"""Width and height of the picture, in pixels."""

SPECS = {"faithful": ("beam-hh",), "best": ("kd", "octree-beam", "bvh-sah")}
"""Structures: the paper's planes and beams, and others with tiles or beams of camera rays."""

MATTE: dict[str, Any] = {"name": "Matte", "base_color": (0.7, 0.5, 0.3), "specular": 0.0}
MIRROR: dict[str, Any] = {"name": "Mirror", "base_color": (1.0, 1.0, 1.0), "metallic": 1.0, "roughness": 0.0}
PANE: dict[str, Any] = {
    "name": "Pane",
    "program": [],
    "closures": [{"kind": "refraction", "roughness": 0.0, "ior": 1.33}],
}

MIRROR_LIMIT = 1e-3
"""Mean difference of a mirrored picture, relative to its mean, up to which it is the same: rounding moves few edges."""


LEAST_SHARE = 0.5
"""Share of the secondary rays that beams must hold, or there is nothing to judge."""


@dataclass(frozen=True)
class Rendered:
    """A picture, the processor seconds it took, and the statistics of the render."""

    pixels: F32
    seconds: float
    statistics: Mapping[str, Any]


def with_sheet(what: str, sheet: F32) -> Workload:
    """The paper's scattered objects and a sheet of two triangles, the last ones. what: the sheet, as text."""
    objects = paper_scenes.scattered()
    count = len(objects.vertices)
    quad = np.array([[0, 1, 2], [0, 2, 3]], np.int32) + count
    return Workload(
        f"{objects.name}, {what}",
        np.concatenate([objects.vertices, sheet]),
        np.concatenate([objects.triangles, quad]),
        objects.view,
    )


def wall() -> Workload:
    """A mirror as wide as the scene behind the objects."""
    return with_sheet(
        "a mirror behind them", np.array([[-3, 1.2, -2], [3, 1.2, -2], [3, 1.2, 2], [-3, 1.2, 2]], np.float32)
    )


def pane() -> Workload:
    """A sheet of glass without thickness in front of the objects, across the view."""
    return with_sheet(
        "a pane before them", np.array([[-2, -1.3, -2], [2, -1.3, -2], [2, -1.3, 2], [-2, -1.3, 2]], np.float32)
    )


def picture(lab: Lab, workload: Workload, spec: str, material: Mapping[str, Any], *, beams: bool) -> Rendered:
    """The picture of the objects and their sheet by Whitted's integrator, on one thread."""
    structure = lab.build(workload, spec)
    index = np.zeros(len(workload.triangles), np.int32)
    index[-2:] = 1
    scene = lab.native.RenderScene(
        structure, materials=[MATTE, dict(material)], material_index=index, world={"color": (1.0, 1.0, 1.0)}
    )
    view = workload.view
    to_world = np.eye(4)
    right, up, forward = view.axes()
    to_world[:3, :3] = np.stack([right, up, -forward], axis=1)
    to_world[:3, 3] = view.eye
    width, height = SIZE
    camera = {
        "kind": "perspective",
        "to_world": to_world,
        "window": view.window(width / height),
        "clip_start": 1e-3,
        "clip_end": 1e6,
    }
    settings = {
        "width": width,
        "height": height,
        "samples": 2 if lab.quick else 8,
        "integrator": "whitted",
        "max_bounces": 4,
        "secondary_beams": beams,
    }
    # Take the processor's time, as the render runs on a thread of its own.
    begun = time.process_time()
    job = lab.native.render(scene, camera, settings, threads=1)
    while not job.wait(1000):
        pass
    seconds = time.process_time() - begun
    if job.error is not None:
        raise RuntimeError(job.error)
    pixels = np.zeros(width * height * 4, np.float32)
    job.copy_into("Combined", pixels)
    return Rendered(pixels, seconds, job.statistics)


def compared(lab: Lab, workload: Workload, spec: str, material: Mapping[str, Any]) -> tuple[float, Rendered, float]:
    """Time of beams over that of single rays, the beams' picture, and its mean difference relative to the mean."""
    ratios = []
    for _ in range(lab.repeats):
        single = picture(lab, workload, spec, material, beams=False)
        beams = picture(lab, workload, spec, material, beams=True)
        ratios.append(beams.seconds / single.seconds)
    difference = float(np.abs(single.pixels - beams.pixels).mean() / single.pixels.mean())
    return median(ratios), beams, difference


def outcomes(lab: Lab, workload: Workload, material: Mapping[str, Any], limit: float) -> Iterator[Outcome]:
    """Time and difference of the picture with beams, structure by structure. limit: of the difference."""
    right = picture(lab, workload, "brute", material, beams=True).pixels
    for configuration, specs in SPECS.items():
        for spec in specs:
            ratio, beams, difference = compared(lab, workload, spec, material)
            statistics = beams.statistics
            share = statistics["rays_beams"] / max(statistics["rays_secondary"], 1)
            wrong = int(np.count_nonzero((beams.pixels != right).reshape(-1, 4).any(axis=1)))
            deviation = np.degrees(statistics["beam_deviation"])
            yield Outcome(
                configuration,
                verdict(holds=share >= LEAST_SHARE and difference <= limit and not wrong),
                f"{workload.name}, {spec}: the picture takes {ratio:.2f} times the time of single rays and differs by "
                f"{difference:.1e} of its mean (limit: {limit:g})",
                f"{share * 100:.0f} % of {statistics['rays_secondary']:,} secondary rays in {statistics['beams']:,} "
                f"beams; largest angle to the single ray {deviation:.2g} degrees",
                Checked((spec,), len(right) // 4, wrong, noun="pixels"),
                {"ratio": ratio, "difference": difference, "share": share, "deviation_degrees": float(deviation)},
            )


def mirrored(lab: Lab) -> Iterator[Outcome]:
    """Beams that a mirror reflects."""
    yield from outcomes(lab, wall(), MIRROR, MIRROR_LIMIT)


def refracted(lab: Lab) -> Iterator[Outcome]:
    """Beams that a boundary refracts; the picture may differ, by how much is the result."""
    yield from outcomes(lab, pane(), PANE, np.inf)


CLAIMS = (
    Claim(
        "mirrored-beams",
        PAPER,
        "Rays that a plane mirrors stay a beam, from the mirror image of the eye.",
        mirrored,
    ),
    Claim(
        "refracted-beams",
        PAPER,
        "Rays that a plane refracts go as a beam approximately, exactly only near the normal.",
        refracted,
    ),
)
