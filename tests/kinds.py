# SPDX-License-Identifier: GPL-3.0-or-later
"""One structure for each kind of tree, for tests of what does not depend on how a tree was built.

The contract tests of the native crate run over all structures.
"""

from __future__ import annotations

import halfspace_native as native

KINDS = (
    "kd",
    "kd-object",
    "rbsp",
    "bsp-ize-kd",
    "bsp-wn-plus-kd",
    "beam-hh",
    "bvh-sah",
    "obb",
    "bih",
    "bih-obl",
    "bbox-gs",
    "octree-net",
    "octree-glassner",
    "grid",
    "brute",
)
"""Memory layouts and traversals that differ: planes across the axes, of few and of any directions, beams, boxes of both
kinds, intervals, octants with and without links, cells, and no tree."""

assert {row["family"] for row in native.structures() if row["id"] in KINDS} == {
    row["family"] for row in native.structures()
}
