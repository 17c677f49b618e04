# SPDX-License-Identifier: GPL-3.0-or-later
"""The presets of `scripts/bench.py`: named sets of scenes, structures and rays."""

from __future__ import annotations

from addon.core.structures import specs

DIRECTIONS = [f"bsp-{kind}{plus}" for kind in ("random", "wn", "cn") for plus in ("", "-plus", "-plus-kd")]
"""The structures that the thesis sweeps over k."""

FAITHFUL = "costs=thesis,ties=pbrt,slab=0,clip=0,traversal=dir"
"""The thesis's costs, stopping rule and tie breaking, without clipping of triangles; `rule=code` is added where its
program has one. Rays are traced singly, as in the kd-tree they are compared with.
"""

OF_THE_THESIS = {
    "scenes": "killeroo-feet,sponza-dabrovic,conference",
    "rays": "primary,shadow,diffuse",
    "k": "2-10",
    "seeds": "1-7",
}


def faithful() -> str:
    """All structures of the thesis with the costs and rules of the thesis."""
    swept = [*DIRECTIONS, "bsp-ize", "bsp-ize-kd", "rbsp:k=13", "rbsp-kd:k=13"]
    made = [specs.joined(spec, FAITHFUL) for spec in swept]
    return ",".join(specs.joined(spec, "rule=code") if "-kd:" in spec else spec for spec in made)


PRESETS: dict[str, dict[str, str]] = {
    "yardstick": {
        "scenes": "sponza-dabrovic,conference,country-kitchen,stanford-dragon,stanford-bunny",
        "structures": "kd,kd:nodes=boxes,traversal=ordered,bsp-wn-plus-kd,"
        "bsp-wn-plus-kd:nodes=boxes,traversal=ordered,bvh-sah",
        "rays": "primary,shadow,diffuse,shuffled",
    },
    "thesis": {**OF_THE_THESIS, "structures": f"kd-sah:traversal=dir,{faithful()}"},
    "directions": {
        **OF_THE_THESIS,
        "structures": ",".join(
            f"{spec}:traversal=dir" for spec in ("kd", *DIRECTIONS, "bsp-ize", "bsp-ize-kd", "rbsp", "rbsp-kd")
        ),
    },
    "beams": {"scenes": "sponza-dabrovic,conference", "structures": "kd", "rays": "primary,shadow"},
}
"""Options of each preset; the command line overrides them."""

AS_PUBLISHED = ("thesis", "directions")
"""Presets that measure scenes as the thesis did, where the scene files record how."""
