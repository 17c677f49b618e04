# SPDX-License-Identifier: GPL-3.0-or-later
"""Other Python threads run while the native module converts the arrays of a call."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from itertools import count
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

ROWS = 1 << 21

TRIES = 20
"""Calls among which another thread has to run during one, however busy the machine is."""

TRIANGLE = np.eye(3, dtype=np.float32), np.arange(3, dtype=np.int32)[None]


def zeros(dtype: str, *shape: int) -> Any:
    return np.zeros((ROWS, *shape), dtype)


def scene(**given: Any) -> Callable[[], Any]:
    """Refused for its light, after the arrays were converted and before the scene is compiled."""
    return lambda: native.RenderScene(ALONE, lights=[{}], **given)


ALONE = native.build(*TRIANGLE)
PLACED = native.build_instances([ALONE], np.zeros(1, np.int32), np.eye(4)[None])
CORNERS = zeros("f4", 3, 3)
INDICES = {"first": np.zeros(1, np.int32), "object": np.zeros(1, np.float32), "material": np.zeros(1, np.float32)}

REFUSED: dict[str, Callable[[], Any]] = {
    "vertices": lambda: native.build(zeros("f4", 3), -TRIANGLE[1]),
    "rounded vertices": lambda: native.build(zeros("f8", 3), -TRIANGLE[1]),
    "triangles": lambda: native.build(np.zeros((0, 3), np.float32), zeros("i4", 3)),
    "material_index": scene(material_index=zeros("i4", 8).reshape(-1)),
    "corner_normals": scene(corner_normals=CORNERS),
    "turned corner_normals": scene(corner_normals=CORNERS.transpose(0, 2, 1)),
    "object_index": scene(object_index=zeros("u4", 8).reshape(-1)),
    "layers": scene(layers=[zeros("f4", 3, 4)]),
    "images": scene(images=[{"name": "", "pixels": zeros("u1", 32, 1).reshape(1 << 13, 1 << 13, 1), "srgb": False}]),
    "grids": scene(grids=[{"values": zeros("f4", 2, 2, 1), "to_index": np.eye(4)[:3]}]),
    "motion": lambda: native.RenderScene(ALONE, indices={**INDICES, "motion": (CORNERS, CORNERS), "groups": 0}),
    "matrices": lambda: native.build_instances([ALONE], np.zeros(1, np.int32), zeros("f8", 3, 4)),
    "surfaces": lambda: native.RenderScene(
        PLACED, surfaces={"meshes": [{"material_index": None, "corner_normals": CORNERS}]}
    ),
}


@pytest.fixture
def uninterrupted() -> Iterator[None]:
    """Threads run only when another one waits or releases the interpreter."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e5)
    yield
    sys.setswitchinterval(before)


@pytest.mark.usefixtures("uninterrupted")
@pytest.mark.parametrize("name", REFUSED)
def test_other_threads_run_while_arrays_are_converted(name: str) -> None:
    steps, done = [0], threading.Event()

    def advance() -> None:
        for steps[0] in count():
            if done.wait(1e-4):
                return

    other = threading.Thread(target=advance)
    other.start()
    try:
        for _ in range(TRIES):
            time.sleep(1e-3)
            before = steps[0]
            with pytest.raises((native.ShapeError, native.SpecError)):
                REFUSED[name]()
            if steps[0] > before:
                return
    finally:
        done.set()
        other.join()
    pytest.fail("no other thread ran during a call")
