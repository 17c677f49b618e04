# SPDX-License-Identifier: GPL-3.0-or-later
"""*Import Settings from Cycles*: what is taken over, and a sentence for each setting without a counterpart."""

from typing import Any

import addon_utils
import bpy
import pytest

from addon.blender.settings import from_cycles, quality
from tests.blender import atlas
from tests.blender.read.test_every_setting import reason_for


@pytest.fixture(name="cycles")
def cycles_settings(scene: Any) -> Any:
    """The settings of Cycles, at their defaults."""
    atlas.with_cycles(scene)
    return scene.cycles


def imported(scene: Any) -> Any:
    assert bpy.ops.halfspace.import_cycles() == {"FINISHED"}
    return scene.halfspace


def test_the_defaults_are_those_of_cycles(scene: Any, cycles: Any) -> None:
    fresh = bpy.data.scenes.new("Fresh")
    other = {"samples", "preview_samples"}
    for theirs, ours in from_cycles.TAKEN.items():
        if ours not in other and theirs in cycles.bl_rna.properties:
            assert getattr(fresh.halfspace, ours) == getattr(fresh.cycles, theirs), ours
    assert from_cycles.without(cycles) == []


def test_every_setting_with_a_counterpart_is_taken_over(scene: Any, cycles: Any) -> None:
    expected = {}
    for theirs, ours in from_cycles.TAKEN.items():
        if (item := cycles.bl_rna.properties.get(theirs)) is None:
            continue
        now = getattr(cycles, theirs)
        if item.type == "BOOLEAN":
            value: Any = not now
        elif item.type == "ENUM":
            value = {"pixel_filter_type": "BOX", "bake_type": "EMIT"}[theirs]
        else:
            value = now + 3 if item.type == "INT" else now * 0.5 + 0.25
        setattr(cycles, theirs, value)
        expected[ours] = pytest.approx(value)
    group = imported(scene)
    assert {ours: getattr(group, ours) for ours in expected} == expected


def test_values_without_an_equal_become_the_nearest(scene: Any, cycles: Any) -> None:
    cycles.samples, cycles.preview_samples = 1 << 24, 0
    cycles.adaptive_threshold = cycles.preview_adaptive_threshold = 0.0
    cycles.pixel_filter_type = "GAUSSIAN"
    group = imported(scene)
    assert (group.samples, group.preview_samples) == (quality.MOST_SAMPLES, quality.MOST_SAMPLES)
    assert group.noise_threshold == group.preview_noise_threshold == pytest.approx(from_cycles.FINEST)
    assert group.pixel_filter_type == "BLACKMAN_HARRIS"
    assert "Filter Type: Blackman-Harris replaces GAUSSIAN." in from_cycles.without(cycles)


def test_what_has_no_counterpart_is_one_sentence_each(scene: Any, cycles: Any) -> None:
    for name, (plain, text) in from_cycles.WITHOUT.items():
        item = cycles.bl_rna.properties.get(name)
        others = {"BOOLEAN": [not plain[0]], "INT": [3], "FLOAT": [0.5]}.get(getattr(item, "type", ""), [])
        for value in others:
            setattr(cycles, name, value)
            assert from_cycles.without(cycles) == [f"{item.name}: {text}."]
            setattr(cycles, name, plain[0])
    cycles.denoising_quality = "FAST"
    assert len(from_cycles.without(cycles)) == 1


@pytest.mark.skipif(bpy.app.version < (5, 2), reason="lists the settings of Cycles in Blender 5.2")
def test_every_setting_of_cycles_is_taken_shared_told_or_listed(cycles: Any) -> None:
    known = {*from_cycles.TAKEN, *from_cycles.SHARED, *from_cycles.WITHOUT}
    names = [one.identifier for one in cycles.bl_rna.properties if one.identifier not in ("rna_type", "name")]
    assert known <= {*names}
    assert [name for name in names if name not in known and not reason_for("Cycles of Scene", name)] == []


def test_without_cycles_one_sentence_says_why(scene: Any) -> None:
    atlas.with_cycles(scene)
    addon_utils.disable("cycles")
    try:
        with pytest.raises(RuntimeError, match="Cycles is disabled in the preferences"):
            bpy.ops.halfspace.import_cycles()
    finally:
        addon_utils.enable("cycles")
