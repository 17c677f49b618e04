# SPDX-License-Identifier: GPL-3.0-or-later
"""A parameter is hidden exactly where no value of it changes the tree, bit for bit."""

from __future__ import annotations

import itertools
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

from addon.core.structures import catalogue, relevance, settings
from addon.core.structures.catalogue import Parameter, Structure

KNOWN = catalogue.load()

OF_RAYS = {relevance.NODES, relevance.TRAVERSAL, "shadow", "robust", "lazy", "beam_least", "beam_min", "any_order"}
"""Parameters that change how rays are traced, not the planes of the tree."""


def of_rays(parameter: Parameter) -> bool:
    """Whether a parameter changes how rays are traced or leaves are tested, not the tree."""
    return parameter.name in OF_RAYS or "scalar" in parameter.options


BY_CHANCE = {"slab", "stop"}
"""Slabs are tried where triangles are parallel to a direction, which few scenes have for all structures. With the costs
of a thesis, where a test is 80 times as dear as a step, both rules of leaves split nearly all nodes.
"""

CONTEXTS: tuple[dict[str, Any], ...] = (
    {},
    {"costs": "thesis"},
    {"k": 3},
    {"k": 3, "costs": "thesis"},
    {"alpha": 0.0},
    {"frames": 1},
)


def soup(rng: np.random.Generator, count: int) -> Any:
    """Triangles of any direction."""
    centres = rng.random((count, 1, 3)) * 8
    return (centres + rng.standard_normal((count, 3, 3)) * 0.5).reshape(-1, 3)


def boxes(rng: np.random.Generator, count: int) -> Any:
    """Boxes parallel to the axes, as corners of triangles."""
    corners = np.array(list(itertools.product((0, 1), repeat=3)), float)
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
    faces += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    placed = [rng.random(3) * 8 + corners * rng.random(3) * 1.2 for _ in range(count)]
    return np.concatenate([one[np.array(faces).reshape(-1)] for one in placed])


def sheets(rng: np.random.Generator, count: int) -> Any:
    """Tilted plates of 32 triangles in one plane."""
    unit = np.array([(a + x, b + y) for a in range(4) for b in range(4) for x, y in ((0, 0), (1, 0), (0, 1))])
    other = np.array([(a + x, b + y) for a in range(4) for b in range(4) for x, y in ((0, 1), (1, 0), (1, 1))])
    cells = np.concatenate([unit, other]) * 0.4
    turned = (np.linalg.qr(rng.standard_normal((3, 3)))[0][:2] for _ in range(count))
    return np.concatenate([rng.random(3) * 8 + cells @ axes for axes in turned])


def crowd(count: int) -> Any:
    """Large triangles of one size, each a little next to the one before: all of them fit best next to one another."""
    corners = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 1]])
    steps = np.arange(count)[:, None, None] * np.array([0.001, 0, 0])
    return (corners[None] + steps).reshape(-1, 3)


def scenes() -> list[tuple[Any, Any]]:
    """Vertices and triangles of several kinds of scenes."""
    rng = np.random.default_rng(5)
    mixed = np.concatenate([soup(rng, 150), boxes(rng, 8), sheets(rng, 4)])
    found = [mixed, boxes(rng, 25), sheets(rng, 10), crowd(30), soup(rng, 500)]
    return [(one.astype(np.float32), np.arange(len(one), dtype=np.int32).reshape(-1, 3)) for one in found]


SCENES = scenes()


def tree(scene: tuple[Any, Any], spec: str) -> tuple[Any, ...]:
    """All that a build makes, without times and texts."""
    made = native.build(*scene, spec, threads=1)
    numbers = {key: value for key, value in made.statistics.items() if key not in ("build_seconds", "left_out")}
    planes = made.split_polygons()
    arrays = [planes[key].tobytes() for key in ("vertices", "offsets", "depth", "kind")]  # type: ignore[literal-required]
    return repr(sorted(numbers.items())), *arrays


def others(parameter: Parameter) -> list[Any]:
    """Values of a parameter besides its default."""
    if parameter.kind == "choice":
        return [option for option in parameter.options if option != parameter.default]
    low, high = parameter.minimum, parameter.maximum
    assert low is not None
    assert high is not None
    if parameter.kind == "integer":
        tried: list[Any] = [int(low), min(int(high), 5), min(int(high), 12), min(int(high), 1)]
    else:
        default = float(parameter.default)
        tried = [low, min(high, default * 3), (low + min(high, 1.0)) / 2]
    return [value for value in dict.fromkeys(tried) if low <= value <= high and value != parameter.default]


def text(structure: Structure, values: dict[str, Any]) -> str:
    """A configuration with these values, also of parameters that are not shown."""
    return structure.id + ":" * bool(values) + ",".join(f"{key}={value}" for key, value in values.items())


def acts(structure: Structure, parameter: Parameter, context: dict[str, Any], plain: list[Any]) -> bool:
    """Whether any value of a parameter changes the tree of any scene. What is refused does not act."""
    for scene, before in zip(SCENES, plain, strict=True):
        for value in others(parameter):
            try:
                after = tree(scene, text(structure, {**context, parameter.name: value}))
            except ValueError as error:
                if "has no effect" not in str(error):
                    raise
                if f"{parameter.name}=" in str(error).partition(" has no effect")[0]:
                    return False
                continue  # with this value another one of the context has none
            if after != before:
                return True
    return False


@pytest.mark.parametrize("structure", KNOWN.structures, ids=lambda one: one.id)
def test_exactly_the_parameters_without_effect_are_hidden(structure: Structure) -> None:
    for context in CONTEXTS:
        if any(structure.parameter(name) is None for name in context):
            continue
        values = relevance.effective(structure, context)
        if any(values[name] != value for name, value in context.items()):
            continue  # out of this structure's range
        shown = set(relevance.relevant(structure, values))
        plain = [tree(scene, text(structure, context)) for scene in SCENES]
        for parameter in structure.parameters:
            name = parameter.name
            if of_rays(parameter) or name in context or (name in BY_CHANCE and parameter in shown):
                continue
            assert (parameter in shown) == acts(structure, parameter, context, plain), (structure.id, context, name)


def test_the_families_of_planes_can_be_built_lazily() -> None:
    lazy = {one.id for one in KNOWN.structures if one.parameter("lazy") is not None}
    begins = "bsp-random", "bsp-wn", "bsp-cn", "bsp-hybrid", "rbsp"
    assert lazy == {"kd", *(one.id for one in KNOWN.structures if one.id.startswith(begins))}
    assert len(lazy) == 15


@pytest.mark.parametrize("id_", ["kd", "bsp-wn", "bsp-cn-plus", "bsp-random-plus-kd", "rbsp"])
def test_a_lazy_build_is_offered_where_it_is_one(id_: str) -> None:
    one = KNOWN[id_]
    offered = one.parameter("traversal")
    assert offered is not None
    for traversal in sorted({"auto", "dir", "tile", "sung", "rope", "projected"}.intersection(offered.options)):
        for shadow in ("none", "cache", "beam"):
            values = relevance.effective(one, {"traversal": traversal, "shadow": shadow})
            shown = "lazy" in {each.name for each in relevance.relevant(one, values)}
            given = f"{id_}:lazy=1,traversal={traversal},shadow={shadow}"
            try:
                waiting = native.build(*SCENES[-1], given).statistics["parts_waiting"] > 0
            except ValueError as error:
                if "lazy" not in str(error):
                    raise
                waiting = False
            assert shown == waiting, given


def test_hidden_values_stay_out_of_the_configuration() -> None:
    one = KNOWN["bsp-wn-plus-kd"]
    values = {"leaf_cost": 9.0, "k_small": 1.0, "alpha": 0.5}
    assert settings.spec(one, values) == "bsp-wn-plus-kd:alpha=0.5,k_small=1,leaf_cost=9"
    assert settings.spec(one, {**values, "costs": "thesis"}) == "bsp-wn-plus-kd:alpha=0.5,costs=thesis"
    assert settings.spec(one, {**values, "k": 3}) == "bsp-wn-plus-kd:k=3,leaf_cost=9"


def test_every_parameter_has_its_place() -> None:
    for structure in KNOWN.structures:
        values = relevance.effective(structure, {})
        grouped = relevance.grouped(structure, values)
        assert list(grouped) == list(relevance.GROUPS)
        together = [one for parameters in grouped.values() for one in parameters]
        assert sorted(one.name for one in together) == sorted(one.name for one in relevance.relevant(structure, values))
        names = [one.name for one in grouped["main"]]
        assert [name for name in names if name in ("k", "alpha")] == names[: len({"k", "alpha"} & set(names))]
        assert len(names) <= 6, structure.id


def test_only_traversals_of_the_chosen_nodes_are_offered() -> None:
    one = KNOWN["kd"]
    for nodes, shadows in (
        ("planes", ["none", "cache", "beam"]),
        ("wide", ["none", "cache"]),
        ("boxes", ["none", "cache"]),
    ):
        able = {way.traversal for way in one.ways if way.nodes == nodes}
        offered = relevance.options(one, {"nodes": nodes})
        assert (set(offered["traversal"]), offered["shadow"]) == (able, shadows)
    # A stored choice that the nodes do not have is replaced, and comes back with its nodes.
    stored = {"nodes": "wide", "traversal": "sung"}
    found = relevance.effective(one, stored)
    assert (found["nodes"], found["traversal"]) == ("wide", "auto")
    assert settings.spec(one, stored) == "kd:nodes=wide"
    assert settings.spec(one, {**stored, "nodes": "planes"}) == "kd:traversal=sung"
    stored = {"nodes": "boxes", "shadow": "beam"}
    assert settings.spec(one, stored) == "kd:nodes=boxes"
    assert settings.spec(one, {**stored, "nodes": "planes"}) == "kd:shadow=beam"
    # A width of nodes that is not the default keeps the traversals that have it.
    narrow = {"width": "4", "traversal": "packet8"}
    assert settings.spec(KNOWN["bvh-sah"], narrow) == "bvh-sah:width=4"


@pytest.mark.parametrize("structure", KNOWN.structures, ids=lambda one: one.id)
def test_offered_traversals_are_understood(structure: Structure) -> None:
    """Every traversal that a menu offers builds, and every other one of the registry is refused."""
    parameter = structure.parameter(relevance.TRAVERSAL)
    nodes = structure.parameter(relevance.NODES)
    for kind in nodes.options if nodes is not None else ("",):
        values = {"nodes": kind} if kind else {}
        offered = relevance.options(structure, values).get(relevance.TRAVERSAL, [])
        assert bool(offered) == (parameter is not None)
        for traversal in parameter.options if parameter is not None else ():
            given = text(structure, {**values, "traversal": traversal})
            if traversal in offered:
                native.build(*SCENES[0], given)
            else:
                with pytest.raises(ValueError, match=traversal):
                    native.build(*SCENES[0], given)


@pytest.mark.parametrize("structure", KNOWN.structures, ids=lambda one: one.id)
def test_rejects_hidden_values(structure: Structure) -> None:
    """A value other than the default that has no effect is an error that names it and what it needs."""
    for context in CONTEXTS:
        if any(structure.parameter(name) is None for name in context):
            continue
        values = relevance.effective(structure, context)
        shown = relevance.relevant(structure, values)
        for parameter in structure.parameters:
            if parameter in shown or parameter.name in context or of_rays(parameter):
                continue
            given = text(structure, {**context, parameter.name: others(parameter)[0]})
            with pytest.raises(ValueError, match=f"{parameter.name}=.* has no effect"):
                native.build(*SCENES[0], given)


def test_choices_have_names() -> None:
    for structure in KNOWN.structures:
        for parameter in structure.parameters:
            labels = [parameter.label_of(option) for option in parameter.options]
            assert len(set(labels)) == len(labels)
            assert all(label[0].isupper() or label[0].isdecimal() for label in labels), labels
            # No choice is shown as a code word.
            words = {"auto", "widen", "clean", "dir", "seq", "pbrt", "fitted"}
            assert not words & {label.lower() for label in labels}, (structure.id, parameter.name)
    one = Parameter("a", "A", "", "", "choice", "x", None, None, ("x", "y"), ("One", "Two"))
    assert [one.label_of(option) for option in "xyz"] == ["One", "Two", "z"]
