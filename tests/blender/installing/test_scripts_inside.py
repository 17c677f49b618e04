# SPDX-License-Identifier: GPL-3.0-or-later
"""Scripts inside a Blender use package and native module of the enabled extension, or refuse it in one line."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import halfspace_native
import pytest

from addon.lab.base import inside
from scripts import package
from tests.blender.user_session import built_wheel, made_zip, session

STEPS = "running"

SCRIPT = ("halfspace", "export", "grid", "--out", "tree.npz")


def test_a_script_takes_the_extension_of_any_repository(zips: dict[str, str], tmp_path: Path) -> None:
    found = session(tmp_path, STEPS, "run", zips["rebuilt"], str(package.ROOT), *SCRIPT)
    assert found["installed"] == ""
    assert found["status"] == 0, found["log"] + found["errors"]
    assert found["out"].startswith("[export] Halfspace 0.1.0 (bl_ext.laboratory.halfspace, halfspace_native_")
    assert found["same"], "one module for both names: it may hold the state of scenes"
    (folder,) = found["package"]
    assert Path(folder).resolve().is_relative_to(tmp_path.resolve())
    assert (tmp_path / "tree.npz").is_file()


def test_a_picture_is_rendered_by_the_extension(zips: dict[str, str], tmp_path: Path) -> None:
    words = ("render", "--percentage", "4", "--samples", "1", "--structure", "bvh-sah", "--out", "picture.png")
    found = session(tmp_path, STEPS, "run", zips["rebuilt"], str(package.ROOT), *words)
    assert found["status"] == 0, found["log"] + found["errors"]
    assert found["same"]
    assert "picture.png: 38 × 21 pixels with bvh-sah" in found["out"]
    assert (tmp_path / "picture.png").is_file()


def test_another_version_is_refused_in_one_line(tmp_path: Path) -> None:
    changes = {"core/base/native.py": lambda text: text.replace('VERSION = "0.1.0"', 'VERSION = "0.0.9"')}
    archive = made_zip(tmp_path, "other", built_wheel(), changes)
    found = session(tmp_path, STEPS, "run", str(archive), str(package.ROOT), *SCRIPT)
    assert found["status"] == 2
    assert found["errors"].splitlines() == [
        (
            "export: the enabled extension (bl_ext.laboratory.halfspace) is Halfspace 0.0.9, this repository is 0.1.0: "
            "use the same version"
        )
    ]
    assert not (tmp_path / "tree.npz").exists()


def test_the_native_module_has_the_interface_of_the_repository() -> None:
    assert inside.differences(halfspace_native) == []


@pytest.mark.parametrize(
    ("lacks", "named"),
    [("build", "build"), ("Monitor", "Monitor"), ("free_memory", "free_memory")],
)
def test_names_what_another_build_lacks(lacks: str, named: str) -> None:
    names = [name for name in dir(halfspace_native) if name != lacks]
    other = SimpleNamespace(**{name: getattr(halfspace_native, name) for name in names})
    assert inside.differences(other) == [named]


def test_other_methods_and_parameters_are_named() -> None:
    def build(vertices: Any, triangles: Any) -> None:
        """Has fewer parameters."""

    everything = {name: getattr(halfspace_native, name) for name in dir(halfspace_native)}
    assert inside.differences(SimpleNamespace(**(everything | {"build": build}))) == ["build"]
    methods = [name for name in dir(halfspace_native.Structure) if not name.startswith("_") and name != "refit"]
    fewer = SimpleNamespace(**{name: getattr(halfspace_native.Structure, name) for name in methods})
    found = inside.differences(SimpleNamespace(**(everything | {"Structure": fewer})))
    assert "Structure.refit" in found
