# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands inside a Blender: its enabled extension takes the place of the repository's `core` and `blender`.

Imports only what Python has loaded by itself, so that a script can begin with it.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import ast

ROOT = Path(__file__).resolve().parents[3]
"""The repository."""

ENGINE = "HALFSPACE"
"""Identifier of the extension's render engine, by which it is found, whatever its package is named."""


class MismatchError(RuntimeError):
    """The extension does not fit to the repository. The message is one line."""


def adopt(name: str) -> None:
    """Make the extension that is enabled in the Blender around a script its package `addon`, and print its version.

    name: of the script, for messages. Does nothing without a Blender. Ends the process with one line and status 2 if
    the extension differs from the repository in version or native interface, or if there is no native module at all.
    """
    bpy = sys.modules.get("bpy")
    if bpy is None:
        return
    try:
        print(f"[{name}] {_adopted(bpy)}", flush=True)
    except MismatchError as error:
        print(f"{name}: {error}", file=sys.stderr, flush=True)
        sys.exit(2)


def _adopted(bpy: Any) -> str:
    """The line that describes what `addon` is from now on. Raises MismatchError."""
    import importlib.util

    kinds = [kind for kind in bpy.types.RenderEngine.__subclasses__() if kind.is_registered]
    packages = [kind.__module__.partition(".blender.")[0] for kind in kinds if getattr(kind, "bl_idname", "") == ENGINE]
    package = next((found for found in packages if found != "addon"), None)
    blender = f"Blender {bpy.app.version_string}"
    if package is None:
        if packages or importlib.util.find_spec("halfspace_native") is not None:
            return f"the repository's package and the installed halfspace_native, in {blender}"
        raise MismatchError(
            f"Halfspace is not enabled in this {blender}: install its zip and enable it, "
            "and start Blender without --factory-startup"
        )
    native = importlib.import_module(f"{package}.core.base.native")
    _compare_versions(native.VERSION, package)
    try:
        module = native.load()
    except native.NativeError as error:
        raise MismatchError(str(error)) from error
    missing = differences(module)
    if missing:
        raise MismatchError(
            f"the native module of the enabled extension ({package}) is of another build than this repository: "
            f"{missing[0]} differs: package the extension again and install it"
        )
    # Give the extension's modules the repository's names too: they hold the states of scenes. The laboratory, which the
    # extension lacks, is found in the repository.
    for name, loaded in list(sys.modules.items()):
        if f"{name}.".startswith(f"{package}."):
            sys.modules["addon" + name.removeprefix(package)] = loaded
    sys.modules["addon"].__path__.append(str(ROOT / "addon"))
    return f"Halfspace {native.VERSION} ({package}, {module.__name__}), in {blender}"


def _compare_versions(found: str, package: str) -> None:
    """Raise MismatchError if the extension's version is not the repository's."""
    import tomllib

    own = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))["version"]
    if found != own:
        raise MismatchError(
            f"the enabled extension ({package}) is Halfspace {found}, this repository is {own}: use the same version"
        )


def differences(module: Any) -> list[str]:
    """Functions, classes and methods of the repository's native interface that a module lacks, or has with other
    parameters.
    """
    import ast

    stub = ROOT / "native" / "python" / "halfspace_native" / "__init__.pyi"
    found: list[str] = []
    dictionaries = {"TypedDict"}
    for item in ast.parse(stub.read_text(encoding="utf-8")).body:
        if isinstance(item, ast.FunctionDef):
            found += _differs(module, item, "")
        elif isinstance(item, ast.ClassDef) and dictionaries & set(map(ast.unparse, item.bases)):
            dictionaries.add(item.name)  # describes a dictionary, and is no class of the module
        elif isinstance(item, ast.ClassDef):
            kind = getattr(module, item.name, None)
            methods = [one for one in item.body if isinstance(one, ast.FunctionDef)]
            found += [item.name] if kind is None else []
            found += [text for one in methods if kind is not None for text in _differs(kind, one, f"{item.name}.")]
    return found


def _differs(owner: Any, function: ast.FunctionDef, prefix: str) -> list[str]:
    """The name of a function of the stub if its owner lacks it, or has it with other parameters."""
    import inspect

    own = getattr(owner, function.name, None)
    if own is None:
        return [prefix + function.name]
    if "overload" in [getattr(one, "id", "") for one in function.decorator_list] or function.name.startswith("__"):
        return []
    try:
        parameters = [name for name in inspect.signature(own).parameters if name != "self"]
    except (TypeError, ValueError):  # properties, and what was compiled without its signature
        return []
    wanted = function.args
    listed = [one.arg for one in (*wanted.posonlyargs, *wanted.args, *wanted.kwonlyargs) if one.arg != "self"]
    return [] if parameters == listed else [prefix + function.name]
