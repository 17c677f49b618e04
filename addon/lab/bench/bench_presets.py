# SPDX-License-Identifier: GPL-3.0-or-later
"""The presets of `scripts/bench.py`: named sets of scenes, structures and rays."""

from __future__ import annotations

from ...core.structures import specs

DIRECTIONS = [f"bsp-{kind}{plus}" for kind in ("random", "wn", "cn") for plus in ("", "-plus", "-plus-kd")]
"""The structures that the thesis sweeps over k."""

FAITHFUL = "costs=thesis,ties=pbrt,slab=0,clip=0,traversal=dir,leaves=scalar"
"""The thesis's costs, stopping rule and tie breaking, without clipping of triangles; its draw of normals,
`rule=code` and `empty_clusters=code` are added where there is one. Rays are traced singly and test one triangle at a
time, as in its kd-tree; also in its RBSP, which computes each plane's two dot products (`dir`).
"""

BASE = "kd-sah:traversal=dir,leaves=scalar"
"""The kd-tree of the thesis."""

OF_THE_THESIS = {
    "scenes": "killeroo-feet,sponza-dabrovic,conference",
    "rays": "primary,shadow,diffuse",
    "k": "2-10",
    "seeds": "1-7",
}


def faithful() -> str:
    """All structures of the thesis with the costs and rules of the thesis."""
    swept = [*DIRECTIONS, "bsp-ize", "bsp-ize-kd", "rbsp:k=13", "rbsp-kd:k=13"]
    return ",".join(map(as_published, swept))


def as_published(spec: str) -> str:
    """A structure of the thesis with its costs and rules."""
    name = specs.structure_of(spec)
    parts = [FAITHFUL]
    if name.startswith(("bsp-wn", "bsp-cn")):
        parts.append("draw=thesis")
    if name.endswith("-kd"):
        parts.append("rule=code")
    if name.startswith("bsp-cn"):
        parts.append("empty_clusters=code")
    return specs.joined(spec, *parts)


FAMILIES = "kd,rbsp-kd,bsp-wn-plus-kd,bih,bvh-sah,bbox-gs,octree-param,octree-net,grid"
"""One structure of each family, which `scripts/bench.py` measures where none is chosen: 47 s for a model of 70,000
triangles without a report (Zen 5).
"""

OF_THE_YARDSTICK = "sponza-dabrovic,conference,country-kitchen,stanford-dragon,stanford-bunny"

PRESETS: dict[str, dict[str, str]] = {
    "yardstick": {
        "scenes": OF_THE_YARDSTICK,
        "structures": "kd,kd:nodes=boxes,traversal=ordered,bsp-wn-plus-kd,"
        "bsp-wn-plus-kd:nodes=boxes,traversal=ordered,bvh-sah",
        "rays": "primary,shadow,diffuse,shuffled",
    },
    "thesis": {**OF_THE_THESIS, "structures": f"{BASE},{faithful()}"},
    "directions": {
        **OF_THE_THESIS,
        "structures": ",".join(
            f"{spec}:traversal=dir" for spec in ("kd", *DIRECTIONS, "bsp-ize", "bsp-ize-kd", "rbsp", "rbsp-kd")
        ),
    },
    "splits": {
        "scenes": OF_THE_YARDSTICK,
        "structures": ",".join(["bvh-sah", *(f"bvh-sah:splits={share}" for share in (0.05, 0.3, 1))]),
        "rays": "primary,shadow,diffuse,shuffled",
    },
    "beams": {"scenes": "sponza-dabrovic,conference", "structures": "kd", "rays": "primary,shadow"},
}
"""Options of each preset; the command line overrides them."""

AS_PUBLISHED = ("thesis", "directions")
"""Presets that measure scenes as the thesis did, where the scene files record how."""
