# SPDX-License-Identifier: GPL-3.0-or-later
"""The inspector's page in a browser: what its buttons, sliders and handles do, and the files that it exports."""

from __future__ import annotations

import base64
import csv
import io
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from addon.core.base import colours, native
from addon.core.base.arrays import F64
from addon.core.inspector import csv_files, histogram, page
from addon.core.measure import costmap
from tests import browsers
from tests.rooms_of_triangles import SIZE, WORKLOAD, built

SPECS = ("kd", "bvh-sah")
DATA = re.compile(r'(<script id="data" type="application/json">)(.*?)(</script>)', re.DOTALL)

EXACT = np.array([[0.1, 2.0**32 - 1, 1 / 3], [65536.0, 2.0**24 + 1, 0.0]])
"""Numbers that a map must keep, rows from the bottom."""


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with browsers.opened() as browser:
        yield browser


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    """The page of two structures, and its data; it lacks some deeper nodes, and one map has EXACT in its corner."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page, "MOST_NODES", 40)
        patch.setattr(page, "MOST_RAYS", 4)
        made = page.inspect(native.load(), WORKLOAD, [(f"The {spec}", built(spec)[0]) for spec in SPECS], SIZE)
    found = DATA.search(made.html)
    assert found is not None
    data = json.loads(found[2])
    overlap = costmap.unpacked(data["structures"][0]["maps"]["OVERLAP"])
    overlap[:2, :3] = EXACT
    data["structures"][0]["maps"]["OVERLAP"] = costmap.packed(overlap)
    path = tmp_path_factory.mktemp("page") / "inspector.html"
    path.write_text(DATA.sub(lambda m: m[1] + json.dumps(data).replace("</", "<\\/") + m[3], made.html), "utf-8")
    return path, data


@pytest.fixture
def data(written: tuple[Path, Any]) -> Any:
    return written[1]


@pytest.fixture
def tab(browser: Any, written: tuple[Path, Any]) -> Iterator[Any]:
    """The page in a tab; the test fails if its script does."""
    context = browser.new_context(viewport={"width": 1200, "height": 900})
    context.set_default_timeout(20_000)
    opened, errors = context.new_page(), []
    opened.on("pageerror", lambda error: errors.append(str(error)))
    opened.on("console", lambda line: errors.append(line.text) if line.type == "error" else None)
    opened.goto(written[0].as_uri())
    opened.wait_for_selector("#maps canvas")
    yield opened
    context.close()
    assert not errors


def values(data: Any, which: int, key: str) -> F64:
    """The numbers of a map, rows from the top."""
    return costmap.unpacked(data["structures"][which]["maps"][key])[::-1]


def end(data: Any, key: str) -> float:
    return next(float(one["end"]) for one in data["quantities"] if one["key"] == key)


def choose(tab: Any, data: Any, key: str) -> None:
    """Show the maps of a quantity."""
    label = next(one["label"] for one in data["quantities"] if one["key"] == key)
    tab.select_option("#quantity", label=label)
    tab.wait_for_function(
        "key => shown.length === structures.length && shown.every(one => one.quantity.key === key)", arg=key
    )


def file(tab: Any, section: Any, button: str) -> tuple[str, bytes]:
    """Name and content of what a button exports."""
    with tab.expect_download() as waiting:
        section.get_by_role("button", name=button, exact=True).click()
    return waiting.value.suggested_filename, Path(waiting.value.path()).read_bytes()


def rows(content: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(content.decode("utf-8"))))


def drawn(tab: Any, which: int) -> Any:
    """(h, w, 4) of the pixels of a map as it is shown, rows from the top."""
    code = "k => document.querySelectorAll('canvas.map')[k].toDataURL().split(',')[1]"
    return browsers.pixels(tab, base64.b64decode(tab.evaluate(code, which)))


def coloured(numbers: F64, most: float) -> Any:
    return 255 * colours.false_colour(numbers / most)


@pytest.mark.parametrize("key", [one.key for one in page.MAPS])
def test_maps_are_exported_with_every_digit_and_in_their_colours(tab: Any, data: Any, key: str) -> None:
    choose(tab, data, key)
    tab.hover("canvas.map >> nth=0")  # the cursor is not part of the files
    for which, spec in enumerate(SPECS):
        section, wanted = tab.locator("#maps > section").nth(which), values(data, which, key)
        name, content = file(tab, section, "CSV")
        assert name == f"{spec}-{key}.csv"
        places = [(int(row["row"]), int(row["column"])) for row in rows(content)]
        assert places == [(y, x) for y in range(SIZE[1]) for x in range(SIZE[0])]
        assert [float(row[key.lower()]) for row in rows(content)] == wanted.ravel().tolist()
        name, content = file(tab, section, "Map PNG")
        assert name == f"{spec}-{key}.png"
        picture = browsers.pixels(tab, content)
        assert np.abs(picture[..., :3] - coloured(wanted, end(data, key))).max() < 2
        assert (picture[..., 3] == 255).all()
    if key == "TIME":
        assert data["structures"][0]["answers"] in tab.locator("#maps").inner_text()


def test_the_picture_of_a_histogram_has_bars_of_its_counts(tab: Any, data: Any) -> None:
    key = "SINGLE_TESTS"
    choose(tab, data, key)
    for which, spec in enumerate(SPECS):
        name, content = file(tab, tab.locator("#maps > section").nth(which), "Histogram PNG")
        assert name == f"{spec}-{key}-histogram.png"
        picture = browsers.pixels(tab, content)
        assert picture.shape == (240, 640, 4)
        counts = histogram.histogram(values(data, which, key), end(data, key)).counts
        # Measure the bars below the handles of the range, in the middle of each bin.
        strip = picture[36 + 10 : 36 + 172, 5:640:10, :3]
        tall = (np.abs(strip - [0x17, 0x18, 0x1C]).max(axis=2) > 8).sum(axis=0)
        assert np.abs(tall - 162 * np.sqrt(counts / counts.max())).max() <= 1


def test_handles_of_a_histogram_select_pixels(tab: Any, data: Any) -> None:
    key = "SINGLE_TESTS"
    choose(tab, data, key)
    most = end(data, key)
    low, high = tab.locator("#maps > section >> nth=0").locator("input").all()
    box = tab.locator("canvas.histogram >> nth=0").bounding_box()

    def drag(start: float, stop: float) -> None:
        tab.mouse.move(box["x"] + start * box["width"], box["y"] + 30)
        tab.mouse.down()
        tab.mouse.move(box["x"] + stop * box["width"], box["y"] + 30)
        tab.mouse.up()

    drag(0.01, 0.2)
    drag(0.99, 0.7)
    ends = float(low.input_value()), float(high.input_value())
    assert ends == pytest.approx((0.2 * most, 0.7 * most), rel=0.02)
    # A pointer that is not held moves nothing, and an end stops at the other one.
    tab.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 30)
    drag(0.21, 0.95)
    assert float(low.input_value()) == pytest.approx(ends[1])
    low.fill(f"{0.2 * most}")
    low.press("Enter")
    for which in (0, 1):
        check_range(tab, values(data, which, key), (float(low.input_value()), float(high.input_value())), most, which)


def check_range(tab: Any, numbers: F64, ends: tuple[float, float], most: float, which: int) -> None:
    """Check that a map has colours inside of the range alone, and its sentence the range's shares."""
    inside = histogram.within(numbers, *ends, most)
    assert 0 < inside.sum() < inside.size
    content = file(tab, tab.locator("#maps > section").nth(which), "Map PNG")[1]
    picture = browsers.pixels(tab, content)[..., :3]
    wanted = 255 * histogram.ranged(numbers, *ends, most)
    assert np.abs(picture - wanted).max() < 2
    text = tab.locator("#maps > section").nth(which).inner_text()
    assert histogram.sentence(numbers, *ends, most) in text


def test_each_map_can_have_a_range_of_its_own_and_keeps_it(tab: Any, data: Any) -> None:
    choose(tab, data, "SINGLE_TESTS")
    read = "() => shown.map(one => one.range)"
    tab.uncheck("#together")
    second = tab.locator("#maps > section >> nth=1").locator("input >> nth=0")
    second.fill(str(end(data, "SINGLE_TESTS") / 2))
    second.press("Enter")
    assert tab.evaluate(read) == [[0, 1], [0.5, 1]]
    choose(tab, data, "DEPTH")
    assert tab.evaluate(read) == [[0, 1], [0, 1]]
    choose(tab, data, "SINGLE_TESTS")
    assert tab.evaluate(read) == [[0, 1], [0.5, 1]]
    # Together again, both have the first one's.
    tab.check("#together")
    assert tab.evaluate(read) == [[0, 1], [0, 1]]


def test_one_cursor_reads_the_same_pixel_of_both_maps(tab: Any, data: Any) -> None:
    key, (x, y) = "SINGLE_TESTS", (31, 12)
    choose(tab, data, key)
    for over in (0, 1):
        box = tab.locator("canvas.map").nth(over).bounding_box()
        tab.mouse.move(box["x"] + (x + 0.5) / SIZE[0] * box["width"], box["y"] + (y + 0.5) / SIZE[1] * box["height"])
        for which in (0, 1):
            number = values(data, which, key)[y, x]
            reading = tab.locator(".reading").nth(which).inner_text()
            assert reading == f"{number:,.0f} per ray at pixel {x}, {y}"
            green = (np.abs(drawn(tab, which)[..., :3] - [90, 255, 140]).max(axis=2) == 0).nonzero()
            assert set(zip(*map(np.ndarray.tolist, green), strict=True)) == {
                *((y, k) for k in range(SIZE[0]) if k != x),
                *((k, x) for k in range(SIZE[1]) if k != y),
            }
        x, y = 47, 31  # the corner


@pytest.mark.parametrize("kind", ["primary", "shadow", "diffuse"])
@pytest.mark.parametrize("order", ["STEPS", "TESTS", "TIME"])
def test_the_worst_rays_follow_each_other(tab: Any, data: Any, kind: str, order: str) -> None:
    tab.select_option("#set", kind)
    tab.select_option("#order", order)
    lists = [one["rays"][f"{kind} {order}"] for one in data["structures"]]
    count = max(map(len, lists))
    assert count > 2
    previous, following = tab.locator("#previous"), tab.locator("#next")

    def check(place: int) -> None:
        for which, rays in enumerate(lists):
            items = tab.locator("#rays > section").nth(which).locator("ul li").all_inner_texts()
            assert items == rays[place]["lines"]
        row = lists[0][place]["row"]
        assert tab.locator(".reading").first.inner_text().endswith(f"at pixel {row['column']}, {row['row']}")
        assert tab.locator("#place").inner_text().startswith(f"{place + 1} of the worst {count}")
        assert previous.is_disabled() == (place == 0)
        assert following.is_disabled() == (place == count - 1)

    check(0)
    for place in range(1, count):
        following.click()
        check(place)
    previous.click()
    check(count - 2)
    # The list as a file: those that were shown, in their order.
    for which, spec in enumerate(SPECS):
        name, content = file(tab, tab.locator("#rays > section").nth(which), "CSV of These Rays")
        assert name == f"{spec}-{kind}-{order}.csv"
        found = rows(content)
        assert found == [{key: str(value) for key, value in ray["row"].items()} for ray in lists[which]]
        assert [int(row["rank"]) for row in found] == list(range(1, len(found) + 1))
        if order == "TIME":
            times = [float(row["nanoseconds"]) for row in found]
            assert times == sorted(times, reverse=True)


def test_the_step_slider_changes_the_numbers(tab: Any, data: Any) -> None:
    for which, spec in enumerate(SPECS):
        steps = data["structures"][which]["rays"]["primary STEPS"][0]["steps"]
        section = tab.locator("#rays > section").nth(which)
        slider, text, lines = (
            section.locator("input[type=range]"),
            section.locator("p.note"),
            section.locator("tbody tr"),
        )

        def check(step: int, steps: Any = steps, text: Any = text, lines: Any = lines) -> None:
            leaves = sum(one["kind"] == "leaf" for one in steps[:step])
            tests = sum(one["tests"] for one in steps[:step])
            said = f"so far {step - leaves} inner nodes, {leaves} leaves, {tests} tests"
            assert text.inner_text() == f"Step {step} of {len(steps)}: {said}"
            assert [k + 1 for k, line in enumerate(lines.all()) if line.get_attribute("class") == "on"] == [step]
            # The line is within its box.
            inside = "line => [line.getBoundingClientRect(), line.closest('.wide').getBoundingClientRect()]"
            line, box = lines.nth(step - 1).evaluate(inside)
            assert box["top"] - 1 <= line["top"] <= line["bottom"] <= box["bottom"] + 1

        for step in (1, len(steps) // 2, len(steps)):
            slider.fill(str(step))
            check(step)
        slider.press("ArrowLeft")
        check(len(steps) - 1)
        lines.nth(3).click()
        check(4)
        lines.nth(5).press("Enter")
        check(6)
        # The node of the step is shown in the tree.
        section.get_by_role("button", name="Show This Node").click()
        first = tab.locator("#trees > section").nth(which).locator("li").first.inner_text()
        assert first == f"Node {steps[5]['node']:,}"
        name, content = file(tab, section, "CSV of Steps")
        assert name == f"{spec}-primary-STEPS-1-steps.csv"
        found = rows(content)
        assert [(int(row["step"]), int(row["node"]), int(row["tests"])) for row in found] == [
            (k, one["node"], one["tests"]) for k, one in enumerate(steps, 1)
        ]
        for name in ("enter", "leave"):
            assert [float(row[name]) if row[name] else None for row in found] == [one[name] for one in steps]


def test_the_tree_is_browsed_node_by_node(tab: Any, data: Any) -> None:
    for which, spec in enumerate(SPECS):
        table, nodes = built(spec)[1], data["structures"][which]["nodes"]
        section = tab.locator("#trees > section").nth(which)

        def press(name: str, section: Any = section) -> None:
            section.get_by_role("button", name=name, exact=True).click()

        def here(section: Any = section) -> int:
            first = section.locator("li").first.inner_text()
            return int(first.removeprefix("Node ").replace(",", ""))

        def down(child: int, section: Any = section) -> None:
            section.locator(".children button").nth(child).click()

        assert here() == 0
        assert section.get_by_role("button", name="Parent", exact=True).is_disabled()
        # Go down along first children until they are not part of the page or end.
        node, depth = 0, 0
        while section.locator(".children button").count():
            children = table.children_of(node).tolist()
            assert section.locator(".children button").count() == len(children)
            down(0)
            node, depth = children[0], depth + 1
            assert here() == node
            assert section.locator("li").nth(1).inner_text().startswith(f"Level {depth}")
        left_out = section.get_by_text("Its children are not part of this page.").count()
        assert left_out == bool(len(table.children_of(node)))
        press("Parent")
        assert here() == table.parent[node]
        if here():
            press("Root")
        assert here() == 0
        # Siblings follow each other in a circle.
        children = table.children_of(0).tolist()
        down(1)
        press("Next")
        assert here() == children[2 % len(children)]
        press("Previous")
        press("Previous")
        assert here() == children[0]
        assert data["structures"][which]["hidden"] in section.inner_text()
        # The nodes of the page as a file.
        name, content = file(tab, section, "CSV of These Nodes")
        assert name == f"{spec}-nodes.csv"
        found = rows(content)
        assert len(found) == len(nodes)
        for row in found:
            wanted = csv_files.node(table, int(row["node"]))
            assert row == {key: str(value) for key, value in wanted.items()}


def test_levels_are_exported(tab: Any, data: Any) -> None:
    for which, spec in enumerate(SPECS):
        name, content = file(tab, tab.locator("#levels > section").nth(which), "CSV")
        assert name == f"{spec}-levels.csv"
        wanted = data["structures"][which]["levels"]
        found = [{key: float(value) if value else None for key, value in row.items()} for row in rows(content)]
        assert found == wanted
        # The table shows the fitted times.
        line = tab.locator("#levels > section").nth(which).locator("tbody tr").first
        shown, known = line.locator("td").last.inner_text(), wanted[0]["fitted_nanoseconds"]
        assert shown == "–" if known is None else float(shown.replace(",", "")) == pytest.approx(known, rel=5e-3)


@pytest.mark.parametrize("width", [390, 1280])
def test_nothing_is_wider_than_the_window(tab: Any, data: Any, width: int) -> None:
    tab.set_viewport_size({"width": width, "height": 800})
    for one in data["quantities"]:
        choose(tab, data, one["key"])
        assert tab.evaluate("document.documentElement.scrollWidth") <= width
