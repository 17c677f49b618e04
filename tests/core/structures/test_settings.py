# SPDX-License-Identifier: GPL-3.0-or-later
"""Configuration strings and render settings."""

import pytest

from addon.core.base.notes import NAMES_SHOWN, Notes
from addon.core.structures.catalogue import Catalogue, Parameter, Structure, load
from addon.core.structures.settings import RenderSettings, SettingsError, spec

K = Parameter("k", "Directions", "How many", "", "integer", 6, 2, 64)


def structure(name: str, *parameters: Parameter, code: int = 1) -> Structure:
    return Structure(name, code, name.title(), "space", "", "", parameters)


def test_a_spec_names_only_what_differs_from_the_defaults() -> None:
    tree = load()["bsp-wn-plus-kd"]
    assert spec(tree, {}) == "bsp-wn-plus-kd"
    assert spec(tree, {"k": 6, "alpha": 0.1, "traversal": "auto"}) == "bsp-wn-plus-kd"
    values = {"k": 8, "alpha": 0.25, "traversal": "dir"}
    assert spec(tree, values) == "bsp-wn-plus-kd:k=8,alpha=0.25,traversal=dir"


def test_a_spec_brings_values_into_range_and_forgets_foreign_keys() -> None:
    values = {"k": 1_000_000, "colour": 3.0, "traversal": "nonsense"}
    assert spec(load()["bsp-wn"], values) == "bsp-wn:k=32"
    assert spec(load()["brute"], {"k": 3}) == "brute"


def test_a_default_that_went_through_f32_is_still_the_default() -> None:
    as_blender_stores_it = 0.10000000149011612
    assert spec(load()["bsp-wn-plus-kd"], {"alpha": as_blender_stores_it}) == "bsp-wn-plus-kd"


def test_parameters_of_one_name_are_merged_wide_enough_for_all() -> None:
    wide = Parameter("k", "Directions", "How many", "", "integer", 13, 1, 200)
    merged = Catalogue([structure("a", K), structure("b", wide, code=2)]).parameters()
    assert (merged["k"].minimum, merged["k"].maximum, merged["k"].default) == (1, 200, 6)


@pytest.mark.parametrize(
    "bad", [{"width": 0}, {"samples": 0}, {"max_bounces": -1}, {"border": (0, 0, 9, 3)}, {"border": (2, 0, 2, 3)}]
)
def test_settings_out_of_range_are_named(bad: dict[str, int]) -> None:
    with pytest.raises(SettingsError, match=next(iter(bad))):
        RenderSettings(**{"width": 4, "height": 3, **bad})  # type: ignore[arg-type]


def test_the_picture_has_the_size_of_the_border() -> None:
    assert RenderSettings(width=4, height=3).size == (4, 3)
    assert RenderSettings(width=4, height=3, border=(1, 0, 3, 1)).size == (2, 1)


def test_rays_are_recorded_on_request() -> None:
    assert "record_rays" not in RenderSettings(width=4, height=3).as_dict()
    assert RenderSettings(width=4, height=3, record_rays=9).as_dict()["record_rays"] == 9


def test_notes_are_grouped_counted_and_cut() -> None:
    notes = Notes()
    assert not notes
    notes.add("Dropped", "A", 2)
    notes.add("Dropped", "B")
    notes.add("Dropped", "A")
    for i in range(NAMES_SHOWN + 2):
        notes.add("Skipped", str(i))
    assert notes.lines() == ["Dropped: A (3), B", "Skipped: 0, 1, 2, 3, 4, 5, 6, 7 and 2 more"]
