# SPDX-License-Identifier: GPL-3.0-or-later
"""The printed tables: like with like, errors next to times, and reasons for what is missing."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from addon.core.measure import ranking
from addon.core.report import report, tables
from addon.lab.report import thesis
from tests.report_rows import ROW, row


def of(
    table: str, spec: str, speed: float = 2.0, *, nodes: str = "planes", rays: tuple[str, str] = ("single", "single")
) -> dict[str, Any]:
    """A row of a table, whose primary and shadow rays go so through such nodes."""
    made = row(spec, speed)
    made["rays"]["shadow"]["n"] = 64
    tree = ",".join(part for part in spec.replace(":", ",").split(",") if not part.startswith(("nodes=", "traversal=")))
    ways = {name: {"nodes": nodes, "rays": way} for name, way in zip(("primary", "shadow"), rays, strict=True)}
    return made | {"table": table, "tables": [table], "tree": tree, "label": tree, "nodes": nodes, "ways": ways}


LIKE = [
    of("single", "kd:traversal=dir", 4.0),
    of("single", "bvh-sah:traversal=ordered", 2.0, nodes="boxes"),
    of("fastest", "kd", 9.0, rays=("tile", "stream")),
    of("fastest", "bvh-sah", 8.0, nodes="boxes", rays=("tile", "stream")),
]


def blocks(rows: list[dict[str, Any]]) -> dict[str, list[str]]:
    """The lines of each table by its title, without the title."""
    found = {}
    for block in tables.text(rows).split("\n\n"):
        title, *lines = block.splitlines()
        found[title.partition(":")[0]] = lines
    return found


def test_every_row_stands_in_the_table_of_its_like_and_each_table_has_its_own_winner() -> None:
    found = blocks(LIKE)
    assert list(found)[:3] == ["room <1>", "One ray at a time", "As fast as it goes"]
    titles, _, kd, bvh, winner = found["One ray at a time"]
    assert titles.split()[:3] == ["structure", "nodes", "rays"]
    assert (kd.split()[:3], bvh.split()[:3]) == (["kd", "planes", "dir"], ["bvh-sah", "boxes", "ordered"])
    assert winner == "Fastest, primary: kd:traversal=dir, 2.00 times bvh-sah:traversal=ordered (95 %: 1.95 to 2.05)"
    _, _, kd, bvh, legend, winner = found["As fast as it goes"]
    assert (kd.split()[:3], bvh.split()[:3]) == (["kd", "planes", "tile+stream"], ["bvh-sah", "boxes", "tile+stream"])
    assert legend == "tile+stream: primary by tile; shadow by stream"
    assert winner == "Fastest, primary: kd, 1.12 times bvh-sah (95 %: 1.12 to 1.13)"


def test_no_ranking_and_no_percentage_mixes_two_tables() -> None:
    single, _, fastest, other = LIKE
    assert not ranking.related(single, fastest, "primary")
    assert not ranking.faster(fastest, single, "primary")
    with pytest.raises(ValueError, match="they share no table"):
        ranking.against(fastest, single, "primary")
    assert ranking.rank([single, fastest], "primary") is None
    assert thesis.percent(single, fastest) is None
    assert thesis.percent(other, fastest) == pytest.approx(100.0 * 9 / 8)
    found = ranking.rank([*LIKE, of("fastest", "grid", 1.0)], "primary")
    assert found is not None
    assert {one["table"] for one in (found.best, *found.equal, found.second)} == {"fastest"}
    assert {id(one) for one in found.apart} == {id(one) for one in LIKE[:2]}
    # The page marks the fastest of each table, and its sentences name the table.
    best = set().union(*(tables.best(own, ["primary"]) for own in ranking.by_table(LIKE).values()))
    assert best == {(id(single), "primary"), (id(fastest), "primary")}
    said = [text for text in report.findings(LIKE) if "Primary rays" in text]
    assert [text.partition(":")[0] for text in said] == ["One ray at a time", "As fast as it goes"]
    assert not any("kd:traversal=dir" in text for text in said[1:])


def test_a_row_of_both_tables_is_ranked_in_both() -> None:
    both = of("single", "octree-net", 6.0) | {"tables": ["single", "fastest"]}
    found = blocks([*LIKE, both])
    assert found["One ray at a time"][-1].startswith("Fastest, primary: octree-net, 1.50 times")
    assert any(line.startswith("octree-net") for line in found["As fast as it goes"])
    # No row is bold in a table where a faster one is.
    own = ranking.by_table([*LIKE, both])
    assert tables.best(own["single"], ["primary"]) == {(id(both), "primary")}
    assert tables.best(own["fastest"], ["primary"]) == {(id(LIKE[2]), "primary")}


def test_of_the_nodes_of_a_tree_those_stand_in_the_table_that_are_quickest_somewhere() -> None:
    planes, boxes = of("fastest", "kd", 9.0), of("fastest", "kd:nodes=boxes", 5.0, nodes="boxes")
    wrong = of("fastest", "kd:nodes=wide", 4.0, nodes="wide")
    wrong["errors"]["false_miss"] = 3
    lines = blocks([planes, boxes, wrong])["As fast as it goes"]
    assert [line.split()[1] for line in lines[2:4]] == ["planes", "wide"], "a row that errs is never left out"
    assert lines[4].startswith("Left out: 1 row")
    boxes["rays"]["shadow"] = copy.deepcopy(boxes["rays"]["primary"])
    lines = blocks([planes, boxes])["As fast as it goes"]
    assert [line.split()[1] for line in lines[2:4]] == ["planes", "boxes"]


def test_lines_align_fit_a_terminal_and_show_errors_zeros_too() -> None:
    long = of("fastest", "bsp-cn-axial-plus-kd", 12.345, nodes="intervals", rays=("tile", "stream"))
    for name in ("diffuse", "shuffled"):
        long["rays"][name] = long["rays"]["primary"]
    embree = row("embree", wrong_triangle=26232, t_ulp_max=375) | {"tables": ["single", "fastest", "chosen"]}
    alike = [of("fastest", f"bsp-cn-axial-plus-kd:k={k}", 12.345, nodes="boxes") for k in range(9)]
    text = tables.text([embree, *LIKE, long, *alike])
    assert max(map(len, text.splitlines())) <= tables.WIDTH
    assert "Embree, whose arithmetic differs: 0 false misses, 0 false hits, 26,232 wrong triangles," in text
    assert "t up to 375 ulps apart" in text
    lines = blocks([of("single", "kd"), of("single", "kd-sah:leaf_size=4")])["One ray at a time"]
    assert len(set(map(len, lines[:4]))) == 1
    assert lines[2].split()[-6:] == ["0"] * 6
    (wrong,) = (blocks([row("kd", wrong_values=3)])["As chosen"][2:],)
    assert wrong[0].split()[-6:] == ["0", "0", "0", "3", "0", "0"]


def test_two_ways_of_the_same_name_are_both_explained() -> None:
    other = of("fastest", "grid", 3.0, nodes="cells", rays=("stream", "tile"))
    both = of("fastest", "obb", 3.0, nodes="boxes", rays=("stream", "stream"))
    lines = blocks([*LIKE, other, both])["As fast as it goes"]
    legend = [line for line in lines if " by " in line]
    assert legend == [
        "tile+stream: primary by tile; shadow by stream",
        "stream+tile: primary by stream; shadow by tile",
    ]
    odd = of("fastest", "grid", 3.0, rays=("tile", "stream"))
    odd["rays"]["diffuse"] = odd["rays"]["primary"]
    odd["ways"]["diffuse"] = {"nodes": "cells", "rays": "tile"}
    legend = [line for line in blocks([*LIKE, odd])["As fast as it goes"] if " by " in line]
    assert legend[1] == "tile+stream: primary, diffuse by tile; shadow by stream"


def test_a_scene_without_hits_has_no_nan_and_says_why() -> None:
    empty = of("fastest", "kd", rays=("tile", "stream"))
    empty["rays"]["shadow"]["n"] = 0
    assert blocks([empty])["As fast as it goes"][2].split()[2] == "tile", "no shadow ray goes by stream"
    text = tables.text([empty])
    assert "nan" not in text.lower()
    assert "No shadow rays: they start where camera rays hit, and none hits the scene." in text
    shadow = copy.deepcopy(empty)
    shadow["rays"]["shadow"] = shadow["rays"]["primary"]
    assert "none hits the scene" not in tables.text([shadow])


def test_a_failed_row_has_its_reason_and_no_line() -> None:
    failed = {**copy.deepcopy(ROW), "rays": None, "errors": None, "build_s": None, "bytes": None, "error": "too large"}
    text = tables.text([failed, of("single", "brute")])
    assert text.splitlines()[-1] == "kd: too large"
    assert "One ray at a time" in text
    assert "As chosen" not in text


def test_too_few_rounds_name_the_best_medians_of_each_table() -> None:
    few = copy.deepcopy(LIKE)
    for one in few:
        for key in ("rounds", "anchor_rounds"):
            one["rays"]["primary"][key] = one["rays"]["primary"][key][:3]
    found = blocks(few)
    told = "3 rounds rank nothing; it takes 6 (--repeats)."
    assert found["One ray at a time"][-1] == f"Best medians: primary kd:traversal=dir. {told}"
    assert found["As fast as it goes"][-1] == f"Best medians: primary kd. {told}"
