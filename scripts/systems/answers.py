# SPDX-License-Identifier: GPL-3.0-or-later
"""Answers of every structure of the compiled module, one hash each: `python answers.py [--rays N] [--out FILE]`.

Needs only NumPy and the module, so that it runs wherever the module does, and its output can be compared between
systems. The scene and the rays consist of sums and products of f32, which IEEE 754 defines to the last bit.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
from pathlib import Path

import halfspace_native as native
import numpy as np
import numpy.typing as npt

TRIANGLES = 2_000

Triangles = tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]
"""Vertices, float32[n, 3], and the numbers of the vertices of each triangle, int32[m, 3]."""

Rays = tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]
"""Origins and directions, both float32[n, 3]."""


def unit(shape: tuple[int, ...], seed: int) -> npt.NDArray[np.float32]:
    """Numbers in [0, 1) of 24 random bits each, the same on every system: Steele et al. 2014, SplitMix64."""
    z = (np.arange(1, np.prod(shape) + 1, dtype=np.uint64) + np.uint64(seed << 40)) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z ^= z >> np.uint64(31)
    return ((z >> np.uint64(40)).astype(np.float32) / np.float32(1 << 24)).reshape(shape)


def triangles() -> Triangles:
    """Vertices and triangles: small ones in general position, some of which share vertices."""
    centres = unit((TRIANGLES, 1, 3), 1) * np.float32(2) - np.float32(1)
    vertices = (centres + unit((TRIANGLES, 3, 3), 2) * np.float32(0.3)).reshape(-1, 3)
    corners = np.arange(3 * TRIANGLES, dtype=np.int32).reshape(-1, 3)
    corners[1::3, 0] = corners[::3, 1][: len(corners[1::3])]
    return vertices, corners


def rays(vertices: npt.NDArray[np.float32], count: int) -> Rays:
    """Origins and directions; every second ray points exactly at a vertex."""
    origins = unit((count, 3), 3) * np.float32(4) - np.float32(2)
    directions = unit((count, 3), 4) * np.float32(2) - np.float32(1)
    directions[::2] = vertices[np.arange(len(directions[::2])) % len(vertices)] - origins[::2]
    return origins, directions


def line(name: str, scene: Triangles, rays: Rays) -> str:
    """Structure, instruction set, rays, hits, bytes of the tree, and a hash of all bits of all answers."""
    structure = native.build(*scene, name)
    hits = structure.closest(*rays)
    digest = hashlib.sha256()
    for answer in (hits.t, hits.u, hits.v, hits.triangle, structure.occluded(*rays)):
        digest.update(np.ascontiguousarray(answer).tobytes())
    found, size = int((hits.triangle >= 0).sum()), structure.statistics["bytes"]
    return f"{name} {native.level()} {len(rays[0])} {found} {size} {digest.hexdigest()[:16]}"


def main(arguments: list[str]) -> int:
    """Print the line of each structure. Returns 1 if two differ on this system, else 0."""
    parser = argparse.ArgumentParser(prog="answers", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rays", type=int, default=1_000_000, help="number of rays (default: 1000000)")
    parser.add_argument("--out", type=Path, help="a file for the lines")
    asked = parser.parse_args(arguments)
    scene = triangles()
    aimed = rays(scene[0], asked.rays)
    lines = []
    for row in native.structures():
        lines.append(line(row["id"], scene, aimed))
        print(lines[-1], flush=True)
    if asked.out is not None:
        asked.out.parent.mkdir(parents=True, exist_ok=True)
        asked.out.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return int(len({text.split()[-1] for text in lines}) > 1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
