# SPDX-License-Identifier: GPL-3.0-or-later
"""The inspector's page: its data are those of the structures, and nothing in it is loaded from elsewhere."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from rooms_of_triangles import WORKLOAD, built

from addon.core.base import native
from addon.core.inspector import page
from addon.core.measure import costmap


def test_a_page_holds_maps_rays_trees_and_levels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page, "MOST_NODES", 20)
    pairs = {spec: built(spec) for spec in ("kd", "bvh-sah")}
    workload = replace(WORKLOAD, name="</script><b>")
    structures = [(f"</script>{spec}", structure) for spec, (structure, _) in pairs.items()]
    size = costmap.shaped(48, (1, 2))
    text = page.as_html(native.load(), workload, structures, size)
    assert "%" + "DATA%" not in text
    assert text.count("</script>") == 2
    assert "&lt;/script&gt;&lt;b&gt;" in text
    assert not re.search(r"(src|href)=\"http", text)
    found = re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    data = json.loads(found[1])
    for entry, (spec, (structure, table)) in zip(data["structures"], pairs.items(), strict=True):
        assert entry["spec"] == spec
        assert set(entry["maps"]) == {one["key"] for one in data["quantities"]}
        values = costmap.measure(structure, WORKLOAD, size, "DEPTH")
        assert np.array_equal(costmap.unpacked(entry["maps"]["DEPTH"]), values)
        assert len(entry["nodes"]) == min(20, len(table))
        assert entry["nodes"][0]["up"] == -1
        assert all(0 <= node["up"] < place for place, node in enumerate(entry["nodes"]) if place)
        assert bool(entry["hidden"]) == (len(table) > 20)
        assert set(entry["rays"]) == {f"{name} {key}" for name, _ in data["sets"] for key, _ in data["orders"]}
        worst = entry["rays"]["primary TESTS"][0]
        assert any(
            line.startswith(f"{sum(step['tests'] for step in worst['steps']):,} tests") for line in worst["lines"]
        )
        assert " of 64 neighbours; 0 of " in entry["rays"]["diffuse TIME"][0]["lines"][0]
        assert len(entry["levels"]) == int(table.depth.max()) + 1
