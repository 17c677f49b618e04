# SPDX-License-Identifier: GPL-3.0-or-later
"""Named structures of the literature, as configurations."""

from __future__ import annotations

from dataclasses import dataclass

from . import specs
from .catalogue import Catalogue, Parameter, Value


@dataclass(frozen=True)
class Preset:
    """A named structure. name: as the source writes it. spec: its configuration."""

    name: str
    spec: str


PRESETS = tuple(
    Preset(name, spec)
    for name, spec in (
        ("Whitted: all rays against all objects", "brute"),
        ("Kd", "kd"),
        ("Kd, as in the thesis", "kd-sah"),
        ("Kd, TA-B", "kd:traversal=ta-b"),
        ("Kd, TA-A", "kd:traversal=ta-a"),
        ("Kd, Sung", "kd:traversal=sung"),
        ("Kd, Arvo", "kd:traversal=arvo"),
        ("Kd, by distances", "kd:traversal=dir"),
        ("Kaplan: regular kd-tree, space median", "kd-median"),
        ("MacDonald and Booth: kd-tree, object median", "kd-object"),
        ("RBSP", "rbsp:k=13"),
        ("RBSP^Kd", "rbsp-kd:k=13"),
        ("BSP_IZE", "bsp-ize"),
        ("BSP_IZE^Kd", "bsp-ize-kd"),
        ("BSP_random", "bsp-random:k=10"),
        ("BSP_random+", "bsp-random-plus:k=10"),
        ("BSP_random+^Kd", "bsp-random-plus-kd:k=10"),
        ("BSP_wn", "bsp-wn:k=6"),
        ("BSP_wn+", "bsp-wn-plus:k=6"),
        ("BSP_wn+^Kd", "bsp-wn-plus-kd:k=6"),
        ("BSP_cn", "bsp-cn:k=6"),
        ("BSP_cn+", "bsp-cn-plus:k=6"),
        ("BSP_cn+^Kd", "bsp-cn-plus-kd:k=6"),
        ("BSP_cn+^Kd, axial", "bsp-cn-axial-plus-kd"),
        ("BSP_wn+^Kd, by area", "bsp-wn-area-plus-kd"),
        ("BSP_hybrid+^Kd", "bsp-hybrid-plus-kd"),
        ("BIH", "bih"),
        ("SKD-tree", "skd"),
        ("BoxTree", "boxtree"),
        ("BIH, five cases", "bih5"),
        ("BIH, one plane", "bih1"),
        ("BIH, four planes", "bih4"),
        ("BIH, n-ary", "bih-n:n=4"),
        ("BIH by SAH", "bih-sah"),
        ("BIH traversed as BVH", "bih-bvh"),
        ("BIH, oblique", "bih-obl"),
        ("BVH", "bvh-sah"),
        ("BVH, two boxes a node", "bvh-sah:width=2"),
        ("SBVH (Stich, Friedrich and Dietrich)", "bvh-sah:splits=0.3"),
        ("Uniform grid (Amanatides and Woo)", "grid"),
        ("Octree, Glassner", "octree-glassner"),
        ("Octree, Arvo", "octree-arvo"),
        ("Octree, parametric", "octree-param"),
        ("Samet-Standard", "octree-samet"),
        ("Samet-Net", "octree-net"),
        ("T.Haces", "octree-beam"),
        ("Beams of Heckbert and Hanrahan", "beam-hh"),
        ("B.Box (OORT)", "bbox-gs"),
        ("B.Box, as published", "bbox-gs:fanout=any,leaf_size=1"),
        ("B.Box, branch and bound", "bbox-gs-bnb"),
    )
)
"""In the order of the sources."""


def offered(catalogue: Catalogue) -> tuple[Preset, ...]:
    """The presets whose structure and parameters the catalogue contains."""
    return tuple(preset for preset in PRESETS if _known(catalogue, preset.spec))


def settings(catalogue: Catalogue, spec: str) -> tuple[str, dict[str, Value]]:
    """The id of a configuration's structure, and the values of all its parameters. Raises specs.SpecError."""
    structure = catalogue.get(specs.structure_of(spec))
    if structure is None:
        known = ", ".join(one.id for one in catalogue.structures)
        raise specs.SpecError(f"unknown structure {spec.partition(':')[0]!r}; there are {known}")
    values: dict[str, Value] = {parameter.name: parameter.default for parameter in structure.parameters}
    given: set[str] = set()
    for key, text in specs.pairs(spec):
        parameter = structure.parameter(key)
        if parameter is None:
            raise specs.SpecError(f"{structure.id} has no parameter {key!r}")
        if key in given:
            raise specs.SpecError(f"{key} is given twice in {spec!r}")
        given.add(key)
        values[key] = _value(parameter, text)
    return structure.id, values


def _known(catalogue: Catalogue, spec: str) -> bool:
    try:
        settings(catalogue, spec)
    except specs.SpecError:
        return False
    return True


def _value(parameter: Parameter, text: str) -> Value:
    try:
        value: Value = {"integer": int, "float": float, "choice": str}[parameter.kind](text)
    except ValueError:
        raise specs.SpecError(f"{parameter.name}: expected a number, got {text!r}") from None
    if parameter.clamp(value) != value:
        raise specs.SpecError(f"{parameter.name}: {text} is out of range")
    return value
