# SPDX-License-Identifier: GPL-3.0-or-later
"""Which configurations are compared with each other: singles with singles, the quickest with the quickest."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import halfspace_native
import pytest

from addon.core.measure import counting, rows
from addon.core.scene import grid, rays
from addon.core.structures import catalogue, specs, ways
from addon.core.structures.catalogue import Parameter, Structure, Way


def structure(name: str, *kinds: Way, **defaults: str) -> Structure:
    """A structure with these ways of tracing, and parameters with these defaults."""
    chosen = {key: tuple(dict.fromkeys(getattr(way, key) for way in kinds)) for key in defaults}
    parameters = [Parameter(k, k, "", "", "choice", d, None, None, chosen[k]) for k, d in defaults.items()]
    return Structure(name, 0, name, "space", "", "", tuple(parameters), (), kinds)


PLANES = structure(
    "kd",
    *(Way("planes", name, rays) for name, rays in (("auto", "auto"), ("dir", "single"), ("sung", "single"))),
    *(Way("planes", name, name) for name in ("packet", "tile", "stream")),
    *(Way("wide", name, rays) for name, rays in (("auto", "auto"), ("flight", "flight"))),
    *(Way("boxes", name, rays) for name, rays in (("auto", "auto"), ("ordered", "single"))),
    nodes="planes",
    traversal="auto",
)
BOXES = structure("obb", Way("boxes", "auto", "auto"), Way("boxes", "ordered", "single"), traversal="auto")
"""A structure with one kernel, which `auto` takes too."""

ALONE = structure("octree-net", Way("octants", "", "single"))
BEAM = structure("octree-beam", Way("octants", "", "tile"))


def test_a_tree_is_traced_by_single_rays_and_by_the_quickest_of_each_kind_of_nodes() -> None:
    assert ways.single(PLANES, "kd:max_depth=9") == "kd:max_depth=9,traversal=dir"
    nodes = ("", ",nodes=wide", ",nodes=boxes")
    assert ways.fastest(PLANES, "kd:max_depth=9") == [f"kd:max_depth=9{more}" for more in nodes]
    assert (ways.single(BOXES, "obb"), ways.fastest(BOXES, "obb")) == ("obb", ["obb"])
    assert (ways.single(ALONE, "octree-net"), ways.fastest(ALONE, "octree-net")) == ("octree-net", ["octree-net"])
    assert (ways.single(BEAM, "octree-beam"), ways.fastest(BEAM, "octree-beam")) == (None, ["octree-beam"])


@pytest.mark.parametrize(
    ("one", "spec", "expected"),
    [
        (PLANES, "kd", ("fastest",)),
        (PLANES, "kd:nodes=boxes", ("fastest",)),
        (PLANES, "kd:traversal=dir", ("single",)),
        (PLANES, "kd:traversal=sung", ("single",)),
        (PLANES, "kd:nodes=boxes,traversal=ordered", ("chosen",)),
        (PLANES, "kd:traversal=packet", ("chosen",)),
        (PLANES, "kd:nodes=wide,traversal=flight", ("chosen",)),
        (PLANES, "kd:nodes=wide,traversal=dir", ("chosen",)),
        (BOXES, "obb", ("single", "fastest")),
        (ALONE, "octree-net:leaf_size=4", ("single", "fastest")),
        (BEAM, "octree-beam", ("fastest",)),
    ],
)
def test_a_configuration_is_in_the_table_where_it_belongs(one: Structure, spec: str, expected: Any) -> None:
    assert ways.tables(one, spec) == expected


def test_a_label_is_the_tree_unless_the_user_spelled_out_more() -> None:
    assert ways.label(PLANES, "kd:max_depth=9,nodes=boxes") == "kd:max_depth=9"
    assert ways.label(PLANES, "kd:traversal=dir") == "kd"
    assert ways.label(PLANES, "kd:traversal=sung") == "kd:traversal=sung"
    assert ways.tree_of("kd:nodes=boxes,max_depth=9,traversal=dir") == "kd:max_depth=9"


def test_spelled_configurations_are_measured_as_they_are_and_refused_ones_are_listed() -> None:
    def build(_vertices: Any, _triangles: Any, spec: str, **_: Any) -> Any:
        """Refuse wide nodes, and spell configurations as they are given."""
        if "nodes=wide" in spec or "colour=3" in spec:
            raise ValueError("not possible")
        return SimpleNamespace(spec=spec)

    known = catalogue.Catalogue((PLANES, BOXES, ALONE))
    left: list[str] = []
    native: Any = SimpleNamespace(build=build, structures=list)
    asked = ["kd", "kd:traversal=sung", "kd:traversal=dir", "octree-net"]
    chosen, trees = ways.compared(native, known, asked, left)
    assert chosen == ["kd:traversal=dir", "kd", "kd:nodes=boxes", "kd:traversal=sung", "octree-net"]
    assert trees == 2
    assert left == ["kd:nodes=wide: not possible"]
    with pytest.raises(specs.SpecError, match="not possible"):
        ways.compared(native, known, ["kd:colour=3"])


@pytest.mark.parametrize("name", [row["id"] for row in halfspace_native.structures()])
def test_every_structure_is_in_the_tables_that_it_is_expanded_for(name: str) -> None:
    one = catalogue.load()[name]
    assert one.ways, "each structure can be traced"
    for spec in ways.fastest(one, name):
        assert "fastest" in ways.tables(one, specs.canonical(halfspace_native, spec))
    spec = ways.single(one, name)
    if spec is None:
        return
    assert "single" in ways.tables(one, specs.canonical(halfspace_native, spec))
    # Rays of that table are traced one by one through the nodes of the tree.
    scene = grid.workload(2, 64)
    tree = halfspace_native.build(scene.vertices, scene.triangles, spec, threads=1)
    sets = rays.make(scene, tree, size=(8, 8), seed=1, names=rays.NAMES)
    for way in counting.ways(tree, sets).values():
        assert way == {"nodes": ways.own_nodes(one), "rays": "single"}


def test_a_row_whose_rays_go_together_leaves_the_table_of_single_rays() -> None:
    scene = grid.workload(2, 64)
    for spec, table in (("kd:traversal=dir", "single"), ("kd:shadow=beam,traversal=dir", "chosen")):
        tree = halfspace_native.build(scene.vertices, scene.triangles, spec, threads=1)
        row = rows.empty(halfspace_native, scene, spec, 1)
        assert row["tables"] == ["single"]
        sets = rays.make(scene, tree, size=(8, 8), seed=1, names=("primary", "shadow"))
        rows.add_ways(row, counting.ways(tree, sets))
        assert (row["table"], row["tables"]) == (table, [table])
