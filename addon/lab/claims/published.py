# SPDX-License-Identifier: GPL-3.0-or-later
"""The published form of each structure: what a configuration needs to stand in a row labelled *faithful*.

A number that a source leaves open is not required here. Triangles are tested one after another (`leaves=scalar`) by
single rays. Packets and polygons of rays have no such leaves, they test one triangle against eight of their rays; nor
have oriented boxes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ...core.measure import yardstick
from ...core.structures import specs

if TYPE_CHECKING:
    from ...core.base.interface import Native

RAYS = "traversal=ordered"
"""Rays one by one through intervals and boxes."""

THESIS = "costs=thesis,ties=pbrt,slab=0,clip=0,leaves=scalar,traversal=dir"
"""Hoobergs 2019."""

FORMS: Mapping[str, str] = {
    # Havran, Kopal, Bittner and Žára 1997; by distances, Hoobergs 2019 and pbrt. Without error bounds exact tests leave
    # the errors of the traversal alone.
    "kd-sah": "traversal=ta-b|ta-a|sung|arvo|dir,leaves=scalar or traversal=ta-b|ta-a|sung|arvo|dir,robust=none",
    # The same in Vinkler, Havran and Bittner 2016, and in Rivera-Alvarado and Zamora-Madrigal 2023.
    "bvh-sah": f"{RAYS},width=2,leaves=scalar or traversal=packet,width=2",
    # Kaplan 1985; MacDonald and Booth 1990.
    "kd-median": "traversal=seq|dir,leaves=scalar",
    "kd-object": "traversal=dir,leaves=scalar",
    # Wächter and Keller 2006.
    "bih": f"{RAYS},split=grid,leaves=scalar or traversal=packet,split=grid or {RAYS},split=grid,robust=none",
    "bih5": f"{RAYS},split=grid,cut=split,leaves=scalar",
    "bih-bvh": "traversal=packet,split=grid",
    # González López and Gisbert Cantó, and what they compare with: at most two objects in a leaf of an octree, the
    # beams polygons that begin with the whole image; boxes after Goldsmith and Salmon 1987.
    "octree-beam": "traversal=polygon,leaf_size=2",
    "octree-net": "leaf_size=2,leaves=scalar",
    "octree-samet": "leaf_size=2,leaves=scalar",
    "octree-glassner": "leaf_size=2,leaves=scalar",
    "bbox-gs": "fanout=any,leaf_size=1,leaves=scalar",
    # Heckbert and Hanrahan 1984.
    "beam-hh": "traversal=beam",
    # Vitsas, Evangelou, Papaioannou and Gkaravelis 2023.
    "obb": "traversal=ordered",
    # Hoobergs 2019; RBSP also with projected rays (Kammaje and Mora 2007, Budge et al. 2008).
    "bsp-random": THESIS,
    "bsp-random-plus": THESIS,
    "bsp-random-plus-kd": f"{THESIS},rule=code",
    "bsp-wn": f"{THESIS},draw=thesis",
    "bsp-wn-plus": f"{THESIS},draw=thesis",
    "bsp-wn-plus-kd": f"{THESIS},draw=thesis,rule=code",
    "bsp-cn": f"{THESIS},draw=thesis,empty_clusters=code",
    "bsp-cn-plus": f"{THESIS},draw=thesis,empty_clusters=code",
    "bsp-cn-plus-kd": f"{THESIS},draw=thesis,rule=code,empty_clusters=code",
    "bsp-ize": THESIS,
    "bsp-ize-kd": f"{THESIS},rule=code",
    "rbsp": f"{THESIS}|projected",
    "rbsp-kd": f"{THESIS}|projected,rule=code",
}
"""Required values of parameters by structure, `|` between those that are allowed and ` or ` between whole forms; of
parameters without an effect nothing is required.
"""


def problem(native: Native, spec: str) -> str:
    """The reason why a configuration is not in published form; "" if it is, or if it is another tracer's."""
    if yardstick.is_foreign(spec) or spec in yardstick.MODES:
        return ""
    name = specs.structure_of(spec)
    if name not in FORMS:
        return f"{name}: no published form is known"
    effective = native.effective(spec)
    problems = []
    for form in FORMS[name].split(" or "):
        for key, allowed in specs.pairs(specs.joined(name, form)):
            if effective.get(key) is not None and str(effective[key]) not in allowed.split("|"):
                problems.append(f"{spec}: {key}={effective[key]}, where {allowed} is published")
                break
        else:
            return ""
    return problems[0]
