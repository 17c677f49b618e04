# SPDX-License-Identifier: GPL-3.0-or-later
"""The inspector's page: its data are those of the structures, and nothing in it is loaded from elsewhere."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from addon.core.base import native
from addon.core.inspector import page
from addon.core.measure import costmap
from tests.rooms_of_triangles import WORKLOAD, built


def test_a_page_holds_maps_rays_trees_and_levels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page, "MOST_NODES", 20)
    pairs = {spec: built(spec) for spec in ("kd", "bvh-sah")}
    workload = replace(WORKLOAD, name="</script><b>")
    structures = [(f"</script>{spec}", structure) for spec, (structure, _) in pairs.items()]
    size = costmap.shaped(48, (1, 2))
    made = page.inspect(native.load(), workload, structures, size)
    text = made.html
    assert "%" + "DATA%" not in text
    assert text.count("</script>") == 2
    assert "&lt;/script&gt;&lt;b&gt;" in text
    assert not re.search(r"(src|href)=\"http", text)
    assert "report" not in re.sub(r"<script.*</script>", "", text, flags=re.DOTALL)
    found = re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    data = json.loads(found[1])
    for entry, (spec, (structure, table)) in zip(data["structures"], pairs.items(), strict=True):
        assert entry["spec"] == spec
        assert set(entry["maps"]) == {one["key"] for one in data["quantities"]}
        # Rays of tiles are on no map: those of the page are traced one by one.
        assert set(entry["maps"]) == {one.key for one in costmap.QUANTITIES} - {"TESTS"}
        wasted, tests = (costmap.unpacked(entry["maps"][key]) for key in ("WASTED", "SINGLE_TESTS"))
        assert (wasted <= tests).all()
        assert np.array_equal(tests, costmap.measure(structure, WORKLOAD, size, "SINGLE_TESTS"))
        values = costmap.measure(structure, WORKLOAD, size, "DEPTH")
        assert np.array_equal(costmap.unpacked(entry["maps"]["DEPTH"]), values)
        assert entry["columns"][0] == "node"
        rows = [node["row"][0] for node in entry["nodes"]]
        met = {step["node"] for rays in entry["rays"].values() for ray in rays for step in ray["steps"]}
        assert met | set(np.argsort(table.depth, kind="stable")[:20].tolist()) <= set(rows)
        assert len(rows) == len(set(rows)) <= len(table)
        # All children of a visited node are there, so that none seems to be missing.
        assert all(set(table.children_of(node).tolist()) <= set(rows) for node in met)
        assert entry["nodes"][0]["up"] == -1
        assert all(0 <= node["up"] < place for place, node in enumerate(entry["nodes"]) if place)
        assert bool(entry["hidden"]) == (len(table) > len(rows))
        assert set(entry["rays"]) == {f"{name} {key}" for name, _ in data["sets"] for key, _ in data["orders"]}
        # The maps agree with the list of rays.
        for key, quantity, place in (("STEPS", "STEPS", 1), ("TESTS", "SINGLE_TESTS", 2)):
            worst = entry["rays"][f"primary {key}"][0]
            x, y = worst["row"]["column"], worst["row"]["row"]
            assert worst["row"]["rank"] == 1
            values = costmap.unpacked(entry["maps"][quantity])
            assert worst["lines"][place].startswith(f"{int(values[size[1] - 1 - y, x]):,} {key.lower()}")
            assert values.max() == values[size[1] - 1 - y, x]
        assert any(line.startswith(f"worst camera ray of </script>{spec}: pixel ") for line in made.worst)
        assert any(
            line.startswith(f"{sum(step['tests'] for step in worst['steps']):,} tests") for line in worst["lines"]
        )
        assert " of 64 neighbours; 0 of " in entry["rays"]["diffuse TIME"][0]["lines"][0]
        assert len(entry["levels"]) == int(table.depth.max()) + 1


def test_a_page_links_the_report_in_its_folder() -> None:
    structures = [("kd", built("kd")[0])]
    text = page.inspect(native.load(), WORKLOAD, structures, (16, 8), report='"&.html').html
    assert '<a href="&quot;&amp;.html">Report of speed and errors</a></nav>' in text
