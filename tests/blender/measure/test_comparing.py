# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparing and choosing structures in Blender: results, panel, report, stopping."""

import dataclasses
import html
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

from addon.blender.measure import compare_files, compare_operators, comparing
from addon.blender.render import engine
from addon.blender.session import trees
from addon.blender.settings import presets, properties
from addon.blender.ui import compare_panels, panels, texts
from addon.core.choose import auto, choice
from addon.core.structures import catalogue, ways
from tests.blender import atlas
from tests.blender.drawn import row
from tests.blender.layouts import Window, draw_all, operator, until_it_ends
from tests.blender.shapes import grid


@pytest.fixture
def seen(scene: Any) -> Any:
    """Boxes before a camera."""
    return row(scene, (64, 64))


def last(scene: Any) -> comparing.Found:
    """The last result of the scene."""
    found = comparing.last(scene)
    assert found is not None
    return found


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Small measurements, and nothing left over."""
    monkeypatch.setattr(comparing, "VIEW_WIDTH", 32)
    monkeypatch.setattr(comparing, "REPEATS", 1)
    yield
    comparing.stop(10.0)


def test_ticked_structures_and_the_chosen_one_are_compared(
    seen: Any, tmp_path: Path, disk_full_at_the_last: Any
) -> None:
    group = seen.halfspace
    group.structure = "kd"
    group.traversal = "dir"
    for structure in catalogue.load().structures:
        setattr(group.compared, properties.tick(structure.id), structure.id in ("kd", "bvh-sah"))
    assert comparing.ticked(group) == ["kd:traversal=dir", "bvh-sah"]
    known = catalogue.load()
    quickest = [spec for name in ("kd", "bvh-sah") for spec in ways.fastest(known[name], name)]
    assert comparing.tried(group) == ["kd:traversal=dir", *quickest]
    assert not bpy.ops.halfspace.write_report.poll()
    assert bpy.ops.halfspace.compare() == {"FINISHED"}
    found = last(seen)
    lines = [line.spec for line in found.comparison.sound]
    assert [ways.tree_of(spec) for spec in sorted(lines)] == ["bvh-sah", "kd", "kd"]
    assert "kd:traversal=dir" in lines
    assert set(lines) <= {"kd:traversal=dir", *quickest}
    assert found.comparison.plan.pixels == 64 * 64
    for panel in compare_panels.CLASSES:
        drawn = draw_all(panel, scene=seen)
        uses = [button.spec for button in drawn.operators if button.id == presets.HALFSPACE_OT_use_spec.bl_idname]
        assert uses == [line.spec for line in found.comparison.lines]
        assert "compared with brute force, 0 wrong" in " ".join(drawn.log)
    assert bpy.ops.halfspace.write_report(directory=str(tmp_path / "report")) == {"FINISHED"}
    document = json.loads((tmp_path / "report" / "bench.json").read_text(encoding="utf-8"))
    assert {row["spec"] for row in document["rows"]} == {"kd:traversal=dir", *quickest}
    assert (tmp_path / "report" / "report.html").stat().st_size > 1000
    found.rows.pop()
    with disk_full_at_the_last(tmp_path / "report"), pytest.raises(RuntimeError, match="No space left"):
        bpy.ops.halfspace.write_report(directory=str(tmp_path / "report"))


def test_a_result_is_kept_in_the_file_as_a_text(seen: Any, tmp_path: Path) -> None:
    seen.name = "Still life"
    assert bpy.ops.halfspace.compare() == {"FINISHED"}
    found = last(seen)
    file = tmp_path / "kept.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file), copy=True)
    with bpy.data.libraries.load(str(file)) as (inside, _):
        assert "Halfspace comparison, Still life" in inside.texts
    content = bpy.data.texts["Halfspace comparison, Still life"].as_string()
    assert f"{found.comparison.best.spec}: build" in content
    assert "(best)" in content
    assert "false miss" in content
    # The next result takes its place.
    assert bpy.ops.halfspace.choose() == {"FINISHED"}
    assert "Choosing took" in bpy.data.texts["Halfspace comparison, Still life"].as_string()
    assert len([text for text in bpy.data.texts if text.name.startswith(compare_files.TEXT)]) == 1


def test_choosing_sets_structure_and_parameters(seen: Any) -> None:
    seen.halfspace.structure = "brute"
    assert bpy.ops.halfspace.choose() == {"FINISHED"}
    found = last(seen)
    assert found.comparison.best.spec in auto.candidates(catalogue.load())
    assert seen.halfspace.structure == found.comparison.best.spec.partition(":")[0]
    assert any("Choosing took" in line for line in found.notes)
    assert all(line.checked >= 64 and not line.wrong for line in found.comparison.sound)
    told = list(compare_files.words(found))
    assert sum("answers wrong" in line for line in told) == len(found.comparison.lines)
    assert not any("0 of 0" in line for line in told)
    for panel in compare_panels.CLASSES:
        assert "compared with brute force, 0 wrong" in " ".join(draw_all(panel, scene=seen).log)


@pytest.mark.parametrize("name", ["compare", "choose"])
def test_says_that_something_else_than_the_picture_is_measured(seen: Any, name: str) -> None:
    seen.camera.data.type = "ORTHO"
    assert getattr(bpy.ops.halfspace, name)() == {"FINISHED"}
    said = "No perspective camera"
    assert said in bpy.data.texts["Halfspace comparison, Scene"].as_string()
    for panel in compare_panels.CLASSES:
        assert said in " ".join(draw_all(panel, scene=seen).log)


def test_a_choice_that_was_measured_on_another_view_says_so(seen: Any) -> None:
    seen.render.engine, seen.halfspace.samples, seen.halfspace.automatic = "HALFSPACE", 1, True
    seen.render.resolution_x = seen.render.resolution_y = 16
    seen.camera.data.type = "ORTHO"
    bpy.ops.render.render()
    report = atlas.report(seen)
    assert [line for line in report.reasons if "No perspective camera" in line]


def test_a_result_is_old_once_the_scene_has_changed(seen: Any) -> None:
    seen.objects["Box 1"].location.z += 0.5  # an edit that nobody has seen when measuring begins
    assert bpy.ops.halfspace.compare() == {"FINISHED"}
    found = last(seen)
    panel = compare_panels.HALFSPACE_PT_view_compare
    assert not found.stale
    assert "The scene has changed since" not in draw_all(panel, scene=seen).log
    seen.camera.location.z += 1
    bpy.context.view_layer.update()
    assert not found.stale
    seen.objects["Box 1"].location.z += 1
    bpy.context.view_layer.update()
    assert "The scene has changed since" in draw_all(panel, scene=seen).log
    assert bpy.ops.halfspace.compare() == {"FINISHED"}
    assert "The scene has changed since" not in draw_all(panel, scene=seen).log


def test_says_which_structures_were_not_compared(seen: Any) -> None:
    line = choice.Line("kd", 1.0, 2.0)
    found = comparing.Found(choice.Comparison(comparing.plan_of(seen), (line,)), ["kd"], comparing.COMPARE)
    assert any("3.00 s; answers not compared" in told for told in compare_files.words(found))
    comparing.FOUND.keep(seen, found)
    for panel in compare_panels.CLASSES:
        assert "Answers not compared" in draw_all(panel, scene=seen).log


def test_a_choice_answers_in_three_lines_and_closes_the_rest(seen: Any) -> None:
    assert bpy.ops.halfspace.choose() == {"FINISHED"}
    found = last(seen)
    layout = draw_all(compare_panels.HALFSPACE_PT_view_compare, scene=seen)
    answer = found.comparison.answer(comparing.name)
    assert len(answer) == 3
    text = " ".join(layout.log)
    assert text.index(answer[0]) < text.index(answer[1]) < text.index(answer[2])
    assert layout.parts == ["HALFSPACE_compared", "HALFSPACE_chosen"]
    assert text.index(answer[2]) < text.index("measured") < text.index("Choosing took")
    room = texts.NARROW - texts.MARGINS
    raw = [spec for spec in auto.candidates(catalogue.load()) if ":" in spec]
    assert raw
    assert not [line for line in layout.log if any(spec in line for spec in raw)], "names in place of specifications"
    assert not [line for line in layout.log if ("left out" in line or "not tried" in line) and texts.wide(line) > room]


def test_compare_and_choose_agree_or_leave_the_best_open(seen: Any, tmp_path: Path) -> None:
    assert bpy.ops.halfspace.choose() == {"FINISHED"}
    chosen = last(seen)
    assert "Compare found" not in chosen.notes[0]
    assert bpy.ops.halfspace.compare() == {"FINISHED"}
    compared = last(seen)
    assert compared.comparison.beside(chosen.comparison, comparing.CHOOSE)
    assert compared.notes[0].endswith(compared.comparison.beside(chosen.comparison, comparing.CHOOSE))
    # The report begins with the sentence of the panel.
    compare_files.write_report(tmp_path, compared)
    assert html.escape(compared.notes[0]) in (tmp_path / "report.html").read_text(encoding="utf-8")
    # A choice of another scene says nothing of this one.
    seen.objects["Box 1"].location.z += 1
    bpy.context.view_layer.update()
    assert bpy.ops.halfspace.choose() == {"FINISHED"}
    assert "Compare found" not in comparing.last(seen).notes[0]


def test_a_render_can_choose_by_itself_and_says_why(seen: Any) -> None:
    seen.render.engine = "HALFSPACE"
    seen.render.resolution_x = seen.render.resolution_y = 16
    seen.halfspace.samples = 1
    seen.halfspace.structure = "brute"
    seen.halfspace.automatic = True
    bpy.ops.render.render()
    report = atlas.report(seen)
    tree = trees.last(seen)
    assert tree.spec in auto.candidates(catalogue.load())
    assert report.label == comparing.name(tree.spec)
    assert any("Choosing took" in line for line in report.reasons)
    assert seen.halfspace.structure == "brute"  # the setting stays the user's
    assert "answers wrong" in report.answers
    assert not report.answers.startswith("0 of 0")
    layout = draw_all(panels.HALFSPACE_PT_statistics, scene=seen)
    drawn = layout.log
    assert "Why this structure" in drawn
    assert report.answers in drawn
    # The answer has three lines, and the rest is closed.
    assert report.reasons[0] == f"{comparing.name(tree.spec)}."
    assert "to build and" in report.reasons[1]
    assert "HALFSPACE_reasons" in layout.parts
    # What was chosen is measured, not what is set.
    assert bpy.ops.halfspace.check() == {"FINISHED"}
    assert trees.last(seen) is tree
    assert tree.spec != "brute"


def test_of_a_structure_that_was_chosen_the_errors_that_were_counted_are_told(
    seen: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen.render.engine, seen.halfspace.samples, seen.halfspace.automatic = "HALFSPACE", 1, True
    seen.render.resolution_x = seen.render.resolution_y = 16
    choose = engine._Picture._choose
    said: list[str] = []

    def err(*arguments: Any) -> Any:
        chosen = choose(*arguments)
        first, *others = chosen.comparison.lines
        lines = (dataclasses.replace(first, wrong=3, checked=1024), *others)
        return dataclasses.replace(chosen, comparison=dataclasses.replace(chosen.comparison, lines=lines))

    monkeypatch.setattr(engine._Picture, "_choose", err)
    monkeypatch.setattr(engine._Picture, "_show_status", lambda _self, text: said.append(text))
    bpy.ops.render.render()
    report = atlas.report(seen)
    assert report.answers == "3 of 1,024 answers wrong"
    assert report.answers in said[-1]


def test_a_result_goes_to_the_scene_that_was_measured(seen: Any) -> None:
    other = bpy.data.scenes.new("Other")
    other.halfspace.structure = seen.halfspace.structure = "brute"
    window, kind = Window(seen), compare_operators.HALFSPACE_OT_choose
    itself = operator(kind)
    assert kind.invoke(itself, window.context, None) == {"RUNNING_MODAL"}
    window.context.scene = other  # the user goes on elsewhere
    assert until_it_ends(kind, itself, window.context) == {"FINISHED"}
    assert other.halfspace.structure == "brute"
    assert seen.halfspace.structure != "brute"
    assert comparing.last(seen) is not None
    assert [text.name for text in bpy.data.texts] == [f"{compare_files.TEXT}, {seen.name}"]


def test_a_result_of_a_scene_that_is_gone_is_said(seen: Any) -> None:
    window, kind = Window(seen), compare_operators.HALFSPACE_OT_compare
    itself = operator(kind)
    assert kind.invoke(itself, window.context, None) == {"RUNNING_MODAL"}
    window.context.scene = bpy.data.scenes.new("Other")
    bpy.data.scenes.remove(seen)
    assert until_it_ends(kind, itself, window.context) == {"CANCELLED"}
    assert itself.said == ["The measured scene was deleted"]
    assert not comparing.FOUND.all()
    assert not bpy.data.texts


@pytest.mark.parametrize("stopped", [True, False])
def test_comparing_goes_on_beside_blender_and_esc_stops_it(seen: Any, add: Any, stopped: bool) -> None:
    add("Sea", grid(60), location=(0, 0, -1))
    window = Window(seen)
    context, calls, texts = window.context, window.calls, window.texts
    kind = compare_operators.HALFSPACE_OT_compare
    itself = operator(kind)
    assert kind.invoke(itself, context, None) == {"RUNNING_MODAL"}
    assert comparing.progress() is not None
    assert kind.modal(itself, context, SimpleNamespace(type="MOUSEMOVE")) == {"PASS_THROUGH"}
    if stopped:
        result = kind.modal(itself, context, SimpleNamespace(type="ESC"))
    else:
        result = until_it_ends(kind, itself, context)
    assert result == ({"CANCELLED"} if stopped else {"FINISHED"})
    assert calls == ["begin", "modal", "no timer", "end"]
    assert texts[-1] is None
    assert (comparing.last(seen) is None) == stopped
    assert comparing.progress() is None
    assert itself.said == (["Measuring was stopped"] if stopped else [])


def test_a_scene_without_triangles_is_an_error(scene: Any) -> None:
    for begin in (bpy.ops.halfspace.compare, bpy.ops.halfspace.choose):
        with pytest.raises(RuntimeError, match="no triangles"):
            begin()
    assert comparing.progress() is None


def test_a_scene_that_keeps_its_instances_is_compared_in_two_levels(seen: Any) -> None:
    seen.halfspace.instancing, seen.halfspace.top = "two-level", "median"
    for structure in catalogue.load().structures:
        setattr(seen.halfspace.compared, properties.tick(structure.id), structure.id in ("kd", "bvh-sah"))
    assert bpy.ops.halfspace.compare() == {"FINISHED"}
    found = last(seen)
    assert {row["spec"] for row in found.rows} == set(comparing.ticked(seen.halfspace))
    assert {row["layout"] for row in found.rows} == {"two levels, the upper one by median"}
    assert all(row["errors"]["rays"] and not row["errors"]["wrong"] for row in found.rows)
    assert found.notes[1] == "Measured in two levels, as Instances is set; top: median"
