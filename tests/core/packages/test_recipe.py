# SPDX-License-Identifier: GPL-3.0-or-later
"""The conda recipe, as rattler-build reads it."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import rattler_build

from addon.core.base import native

ROOT = Path(__file__).resolve().parents[3]

RECIPE = (ROOT / "distribution" / "recipe.yaml").read_text(encoding="utf-8")

PROJECTS = {"halfspace-native": "pyproject.toml", "halfspace-rt": "distribution/pyproject.toml"}

RENAMED = {"openimageio": "py-openimageio"}
"""Names of packages at conda-forge, where they differ from those at PyPI."""


def names(requirements: list[Any]) -> set[str]:
    return {re.split(r"[ =<>;]", str(one))[0].lower() for one in requirements}


def test_the_recipe_makes_both_packages_of_this_version() -> None:
    rendered = rattler_build.Stage0Recipe.from_yaml(RECIPE).render()
    made = {one.recipe.package.name: one.recipe.to_dict() for one in rendered}
    assert made.keys() == PROJECTS.keys()
    for name, file in PROJECTS.items():
        project = tomllib.loads((ROOT / file).read_text(encoding="utf-8"))["project"]
        recipe = made[name]
        assert recipe["package"]["version"] == project["version"] == native.VERSION
        assert recipe["about"]["license"] == project["license"]
        needed = {RENAMED.get(one, one) for one in names(project["dependencies"])}
        assert names(recipe["requirements"]["run"]) == {"python", *needed}
    assert not re.search(r"/(home|root|work)/", RECIPE)


@pytest.mark.parametrize(
    ("right", "wrong"),
    [("license_file:", "licence_file:"), ("outputs:", "output:"), ("compiler('rust')", "compiler('rust'")],
)
def test_a_broken_recipe_is_noticed(right: str, wrong: str) -> None:
    assert right in RECIPE
    with pytest.raises(Exception, match=r"unknown field|missing required field|syntax error"):
        rattler_build.Stage0Recipe.from_yaml(RECIPE.replace(right, wrong)).render()
