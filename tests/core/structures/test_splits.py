# SPDX-License-Identifier: GPL-3.0-or-later
"""Spatial splits of `bvh-sah`: the parameter and its statistics; `native/tests/splits.rs` has the answers."""

from __future__ import annotations

import halfspace_native as native
import numpy as np
import pytest

from addon.core.structures import catalogue, relevance, settings
from addon.lab.bench.bench_presets import PRESETS

BVH = catalogue.load()["bvh-sah"]


def beams(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Long thin triangles across a room, as vertices and triangles."""
    rng = np.random.default_rng(4)
    ends = rng.uniform(-1, 1, (count, 2, 3))
    corners = np.concatenate([ends, ends[:, 1:] + rng.uniform(-0.01, 0.01, (count, 1, 3))], 1)
    return corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def test_the_parameter_is_shown_for_eight_boxes_only() -> None:
    def shown(values: dict[str, str]) -> set[str]:
        return {one.name for one in relevance.relevant(BVH, relevance.effective(BVH, values))}

    assert "splits" in shown({})
    assert "splits" not in shown({"width": "4"})
    assert settings.spec(BVH, {"splits": 0.3}) == "bvh-sah:splits=0.3"
    assert settings.spec(BVH, {"splits": 0.3, "width": "4"}) == "bvh-sah:width=4"


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("bvh-sah:splits=5", "splits=5 is not a number from 0 to 4"),
        ("bvh-sah:splits=-0.1", "splits=-0.1 is not a number from 0 to 4"),
        ("bvh-sah:splits=some", "splits=some is not a number from 0 to 4"),
        ("bvh-sah:splits=1,width=2", "splits=1 has no effect in 'bvh-sah' with width=2; it needs width=8"),
        ("bvh-sah:quality=fast,splits=1", "with quality=fast; it needs quality=medium"),
        ("bvh-sah:quality=high,width=4", "quality=high needs width=8 in 'bvh-sah', got width=4"),
        ("kd:splits=1", "'kd' has no key 'splits'"),
    ],
)
def test_mistakes_are_named(spec: str, message: str) -> None:
    with pytest.raises(native.SpecError) as raised:
        native.build(*beams(4), spec)
    assert message in str(raised.value)


def test_a_quality_leaves_out_what_its_tree_has_not() -> None:
    assert native.effective("bvh-sah:splits=0.3")["splits"] == 0.3
    assert native.effective("bvh-sah:splits=0.3,quality=fast")["splits"] is None
    assert native.effective("bvh-sah:width=4,quality=high")["quality"] == "medium"
    high = native.build(*beams(2000), "bvh-sah:quality=high").statistics
    assert high["references"] == native.build(*beams(2000), "bvh-sah:splits=0.3").statistics["references"] > 2000


def test_references_are_counted_and_bounded() -> None:
    vertices, triangles = beams(2000)
    whole = native.build(vertices, triangles, "bvh-sah").statistics
    assert whole["references"] == len(triangles)
    costs = [whole["sah_cost"]]
    for share in (0.1, 0.5, 4.0):
        cut = native.build(vertices, triangles, f"bvh-sah:splits={share}")
        assert cut.validate() == []
        assert len(triangles) < cut.statistics["references"] <= len(triangles) * (1 + share)
        costs.append(cut.statistics["sah_cost"])
        with pytest.raises(native.RefitError, match=r"^bvh-sah cannot be fitted to moved triangles: .*build it again"):
            cut.refit(vertices)
    assert costs == sorted(costs, reverse=True), "more splits, closer boxes"


def test_triangles_without_splits_are_named_and_can_be_refitted() -> None:
    steps = 2 * np.arange(20, dtype=np.float32)
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    apart = (corners[None] + steps[:, None, None] * np.array([1, 0, 0], np.float32)).reshape(-1, 3)
    triangles = np.arange(60, dtype=np.int32).reshape(-1, 3)
    built = native.build(apart, triangles, "bvh-sah:splits=1")
    assert any(line.startswith("spatial splits: ") for line in built.statistics["left_out"])
    assert built.refit(apart).statistics["refits"] == 1


def test_the_preset_measures_several_budgets() -> None:
    structures = PRESETS["splits"]["structures"].split(",")
    assert structures[0] == "bvh-sah"
    assert len(structures) > 2
    assert all(spec.startswith("bvh-sah:splits=") for spec in structures[1:])
