# SPDX-License-Identifier: GPL-3.0-or-later
"""Rooms of the Python sources: each imports only rooms before it in one order, and no modules form a circle."""

from __future__ import annotations

from pathlib import Path

import imports
import pytest

ROOT = Path(__file__).resolve().parents[3]

ORDER = tuple(
    f"{package}.{room}"
    for package, rooms in (
        ("addon", "refusal"),
        ("addon.core", "base scene structures tree session measure choose overlay inspector report"),
        ("addon.blender", "read settings state session samples measure render overlay inspector ui"),
        ("lab", "base reported stability motion claims growth export bench thesis pictures lessons"),
    )
    for room in rooms.split()
)
"""The rooms; each may import those before it and itself. `addon`, `addon.core` and `addon.blender` themselves are not
rooms: they hold no more than their `__init__.py`."""


def room(module: str) -> str:
    """The room of a module, or the empty string for a package that holds rooms."""
    return next((name for name in ORDER if f"{module}.".startswith(f"{name}.")), "")


def upward(found: list[imports.Import]) -> list[str]:
    """Imports of a room after the importer's own, one line each."""
    return [
        f"{one.importer}:{one.line} imports {one.imported}"
        for one in found
        if room(one.importer)
        and room(one.imported)
        and ORDER.index(room(one.imported)) > ORDER.index(room(one.importer))
    ]


@pytest.fixture(scope="module")
def known() -> dict[str, Path]:
    return imports.modules(ROOT / "addon", "addon") | imports.modules(ROOT / "lab", "lab")


@pytest.fixture(scope="module")
def found(known: dict[str, Path]) -> list[imports.Import]:
    return imports.imports(known)


def test_each_module_stands_in_a_room(known: dict[str, Path]) -> None:
    assert [name for name in known if not room(name)] == ["addon", "addon.blender", "addon.core", "lab"]
    assert {room(name) for name in known} == {*ORDER, ""}


def test_no_room_imports_a_later_one(found: list[imports.Import]) -> None:
    assert len(found) > 400
    assert upward(found) == []


def test_no_modules_import_each_other_in_a_circle(found: list[imports.Import]) -> None:
    assert imports.circles(found) == []


def test_the_extension_imports_itself_relatively_and_never_the_laboratory(known: dict[str, Path]) -> None:
    # The package of an installed extension has another name.
    for name, path in known.items():
        if name.startswith("addon") and path.suffix == ".py":
            lines = path.read_text(encoding="utf-8").splitlines()
            assert not [one for one in lines if one.lstrip().startswith(("from addon", "import addon.", "from lab"))], (
                name
            )


# The checks above can fail: each fault is found in a small tree that has it.


def written(folder: Path, files: dict[str, str]) -> list[imports.Import]:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return imports.imports(imports.modules(folder, "addon"))


@pytest.mark.parametrize(
    "line",
    [
        "from ..scene import rays",
        "from ..scene.rays import cast",
        "def late():\n    from ..scene import rays",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from ..scene import rays",
        "import addon.core.scene.rays",
    ],
)
def test_an_upward_import_is_found(tmp_path: Path, line: str) -> None:
    found = written(tmp_path, {"core/base/notes.py": line, "core/scene/rays.py": "from ..base import files\n"})
    assert [one.partition(" ")[2] for one in upward(found)] == ["imports addon.core.scene.rays"]


def test_a_circle_is_found_also_where_an_import_is_late(tmp_path: Path) -> None:
    files = {
        "core/base/a.py": "from . import b",
        "core/base/b.py": "from .c import x",
        "core/base/c.py": "def x():\n    from . import a",
        "core/base/d.py": "from . import a",
    }
    circle = [f"addon.core.base.{name}" for name in "abc"]
    assert imports.circles(written(tmp_path, files)) == [circle]
    files["core/base/c.py"] = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from . import a"
    assert imports.circles(written(tmp_path, files)) == []
