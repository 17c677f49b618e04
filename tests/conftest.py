# SPDX-License-Identifier: GPL-3.0-or-later
"""The fixtures of all tests, and what each process that runs tests is."""

from __future__ import annotations

import atexit
import importlib.util
import os
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

from addon.core.report import results

# A shell that starts the tests in the background has them ignore Ctrl-C, and all processes that they start.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Before bpy is imported: tests must neither read nor write the settings of the user's own Blender, nor of one another.
resources = tempfile.TemporaryDirectory(prefix="halfspace-blender-")
os.environ["BLENDER_USER_RESOURCES"] = resources.name

# A slow machine is no fault of what is tested. The same is drawn everywhere: left alone, hypothesis does so only where
# it sees a CI, and what fails there passes anywhere else. `--hypothesis-profile=search` draws anew at each run.
settings.register_profile("halfspace", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None, derandomize=False)
settings.load_profile("halfspace")


BLENDER = Path(__file__).parent / "blender"


def pytest_pycollect_makemodule(module_path: Path) -> None:
    """Import Blender before the first file of its tests; skip them where it is not installed."""
    if module_path.is_relative_to(BLENDER):
        bpy = pytest.importorskip("bpy", reason="Blender's module bpy is not installed in this environment")
        if importlib.util.find_spec("OpenImageIO") is None:
            bpy.utils.expose_bundled_modules()


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Leave at once after the last words: Blender 4.5 as a module hangs when Python ends after a render."""

    def leave() -> None:
        resources.cleanup()
        os._exit(int(session.exitstatus))

    if "bpy" in sys.modules:
        atexit.register(leave)


@pytest.fixture
def disk_full_at_the_last() -> Callable[[Path], AbstractContextManager[None]]:
    """While the disk is full for the last of as many files as a folder holds, none of these files may change."""

    @contextmanager
    def full(folder: Path) -> Iterator[None]:
        old = {path.name: path.read_bytes() for path in folder.iterdir()}
        written: list[int] = []

        def write(handle: int) -> None:
            written.append(handle)
            if len(written) == len(old):
                raise OSError(28, "No space left on device")

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(results.os, "fsync", write)
            yield
        assert len(written) == len(old) > 1, "it came to the last file"
        assert {path.name: path.read_bytes() for path in folder.iterdir()} == old, "all old, or all new"

    return full


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Two small files."""
    from tests.sweep_runs import soups

    return soups(tmp_path_factory.mktemp("scenes"), 2, 300)


@pytest.fixture
def whole(scenes: list[str], tmp_path: Path) -> list[dict[str, Any]]:
    """The rows of one uninterrupted sweep over both in this process."""
    from addon.lab.commands import bench
    from tests.sweep_runs import OPTIONS, ROWS, table

    assert bench.main([*scenes, *OPTIONS, "--out", str(tmp_path / "whole")]) == 0
    found = table(tmp_path / "whole")
    assert len(found) == 2 * ROWS
    return found


@pytest.fixture(scope="session")
def _addon() -> Iterator[None]:
    """The add-on, registered once: Blender as a module is one per process."""
    import addon

    addon.register()
    yield
    addon.unregister()


@pytest.fixture(autouse=True)
def _own_file(request: pytest.FixtureRequest) -> None:
    """Start each test with Blender from an empty file."""
    if request.module.__name__.startswith("tests.blender."):
        request.getfixturevalue("scene")


@pytest.fixture
def scene(_addon: None) -> Any:
    """The scene of an empty file. Its pictures have all their samples and keep their noise, unlike by default."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    group = bpy.context.scene.halfspace
    group.use_adaptive = group.use_preview_adaptive = group.use_denoising = False
    return bpy.context.scene


@pytest.fixture
def add(scene: Any) -> Any:
    """Adds an object with this data to the scene: add(name, data, location=..., ...)."""
    import bpy

    def add(name: str, data: Any, **properties: Any) -> Any:
        item = bpy.data.objects.new(name, data)
        scene.collection.objects.link(item)
        for key, value in properties.items():
            setattr(item, key, value)
        return item

    return add


@pytest.fixture
def canvas(request: pytest.FixtureRequest) -> Any:
    """A surface to draw on without a window, of the size that the test's file says."""
    import gpu

    if not hasattr(gpu, "init"):
        pytest.skip("this Blender cannot draw without a window (gpu.init came with 5.2)")
    try:
        gpu.init()
    except Exception as error:
        pytest.skip(f"no drawing here: {error}")
    return gpu.types.GPUOffScreen(request.module.WIDTH, request.module.HEIGHT, format="RGBA16F")


@pytest.fixture(scope="session")
def zips(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The paths of the zips of `builds.zips`."""
    from tests.blender.installing import builds

    return builds.zips(tmp_path_factory.mktemp("zips"))
