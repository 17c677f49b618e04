# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender as a module is one per process: the add-on is registered once, and each test starts from an empty file."""

import importlib.util
from collections.abc import Iterator
from typing import Any

import pytest

bpy = pytest.importorskip("bpy", reason="Blender's module bpy is not installed in this environment")

if importlib.util.find_spec("OpenImageIO") is None:
    bpy.utils.expose_bundled_modules()

import gpu  # noqa: E402

import addon  # noqa: E402


@pytest.fixture(scope="session", autouse=True)
def _addon() -> Iterator[None]:
    addon.register()
    yield
    addon.unregister()


@pytest.fixture(autouse=True)
def scene(_addon: None) -> Any:
    """The scene of an empty file."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return bpy.context.scene


@pytest.fixture
def add(scene: Any) -> Any:
    """Adds an object with this data to the scene: add(name, data, location=..., ...)."""

    def add(name: str, data: Any, **properties: Any) -> Any:
        item = bpy.data.objects.new(name, data)
        scene.collection.objects.link(item)
        for key, value in properties.items():
            setattr(item, key, value)
        return item

    return add


@pytest.fixture
def canvas(request: pytest.FixtureRequest) -> Any:
    """What is drawn on without a window, of the size that the test's file says."""
    if not hasattr(gpu, "init"):
        pytest.skip("this Blender cannot draw without a window (gpu.init came with 5.2)")
    try:
        gpu.init()
    except Exception as error:
        pytest.skip(f"no drawing here: {error}")
    return gpu.types.GPUOffScreen(request.module.WIDTH, request.module.HEIGHT, format="RGBA16F")
