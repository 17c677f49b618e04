# SPDX-License-Identifier: GPL-3.0-or-later
"""Callers in another floating-point mode get the same answers, and keep their mode.

Embree recommends flush-to-zero, and libraries compiled with -ffast-math set it when they are loaded.
"""

from __future__ import annotations

import ctypes
import platform
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

from tests.kinds import KINDS
from tests.render_scenes import camera, settings

X86_GLIBC = platform.machine() in ("x86_64", "AMD64") and platform.libc_ver()[0] == "glibc"
pytestmark = pytest.mark.skipif(not X86_GLIBC, reason="the mode is set through fenv_t of glibc on x86-64")

MODES = {
    "flush to zero": 0x8000,
    "denormals are zero": 0x0040,
    "both": 0x8040,
    "down": 0x2000,
    "up": 0x4000,
    "towards zero": 0x6000,
}
"""Bits of MXCSR (Intel's manual, volume 1, 10.2.3)."""

BITS = 0xE040
LIBRARY: Any = ctypes.CDLL("libm.so.6") if X86_GLIBC else None


def mode(value: int | None = None) -> int:
    """Sets these bits of MXCSR on the calling thread, the last word of fenv_t. Returns the former ones."""
    environment = (ctypes.c_uint32 * 8)()
    LIBRARY.fegetenv(environment)
    former = environment[7] & BITS
    if value is not None:
        environment[7] = environment[7] & ~BITS | value
        LIBRARY.fesetenv(environment)
    return former


@contextmanager
def within(value: int) -> Iterator[None]:
    """The mode on the calling thread; checks that it is still there at the end."""
    former = mode(value)
    try:
        yield
        assert mode() == value, "the caller's mode stays"
    finally:
        mode(former)


def packed(hits: Any) -> bytes:
    return b"".join(array.tobytes() for array in (hits.t, hits.triangle, hits.u, hits.v))


@cache
def small() -> tuple[Any, Any, Any, Any]:
    """Made in the default mode: a mesh with all digits and some subnormal numbers, rays in float64."""
    random = np.random.default_rng(3)
    vertices = (random.normal(size=(90, 3)) / 3).astype(np.float32)
    vertices[:30] *= np.float32(2.0**-126)
    triangles = random.integers(0, 90, (60, 3)).astype(np.int32)
    origins = random.normal(size=(64, 3)) / 7
    directions = vertices[triangles[np.arange(64) % 60]].mean(axis=1) - origins
    origins[:16] *= 2.0**-124
    return vertices, triangles, origins, directions


def traced(spec: str, threads: int = 1) -> bytes:
    vertices, triangles, origins, directions = small()
    built = native.build(vertices, triangles, spec, threads=threads)
    hits = built.closest(origins, directions, threads=threads)
    return packed(hits) + built.occluded(origins, directions, threads=threads).tobytes()


EXPECTED = {spec: traced(spec) for spec in KINDS}
"""In the default mode."""


@pytest.mark.parametrize("value", MODES.values(), ids=MODES.keys())
def test_every_structure_answers_the_same_on_all_threads(value: int) -> None:
    with within(value):
        found = {spec: traced(spec) for spec in KINDS}
        threaded = traced("kd:lazy=1", threads=2), traced("bvh-sah", threads=2)
    assert [spec for spec in KINDS if found[spec] != EXPECTED[spec]] == []
    assert threaded == (EXPECTED["kd"], EXPECTED["bvh-sah"])


MATRICES = np.stack([np.eye(4), np.diag([1 / 3, 1.1, 0.7, 1])])


def everything() -> dict[str, Any]:
    """The results of all other functions that compute."""
    vertices, triangles, origins, directions = small()
    built = native.build(vertices, triangles, "kd")
    instances = native.build_instances([built], np.zeros(2, np.int32), MATRICES)
    path = built.trace_path([0.1, 0.2, 1.3], [-0.1, -0.2, -1.3], 0.1, 10.1)
    film = picture(built)
    recording = built.record(origins, directions)
    recording.replay()
    return {
        "exact": packed(native.exact_closest(vertices, triangles, origins, directions)),
        "instances": packed(instances.closest(origins, directions)),
        "flattened": instances.flattened()[0].tobytes(),
        "path": np.array([path["t"], path["u"], path["v"], *path["visits"]["enter"]]).tobytes(),
        "recording": {key: value.tobytes() for key, value in recording.counters.items()},
        "analysis": np.array([built.analysis()[name] for name in ("sah_nodes", "sah_tests", "epo")]).tobytes(),
        "cost": built.statistics["sah_cost"],
        "export": {key: np.asarray(value).tobytes() for key, value in built.export().items()},
        "planes": built.split_polygons()["vertices"].tobytes(),
        "cells": built.leaf_cells()["vertices"].tobytes(),
        "valid": built.validate(),
        "cases": b"".join(case["origins"].tobytes() for case in native.cases("small", seed=5)[:12]),
        "picture": film,
    }


def picture(built: Any) -> bytes:
    job = native.render(native.RenderScene(built), camera(), settings(width=16, height=16, samples=2))
    assert job.wait(600_000)
    pixels = np.zeros(16 * 16 * 4, np.float32)
    job.copy_into("Combined", pixels)
    return pixels.tobytes()


@pytest.mark.parametrize("name", ["both", "up"])
def test_all_functions_compute_in_the_default_mode(name: str) -> None:
    expected = everything()
    with within(MODES[name]):
        found = everything()
    assert [key for key in expected if found[key] != expected[key]] == []


def test_an_error_leaves_the_mode_too() -> None:
    vertices, triangles, *_ = small()
    with within(MODES["up"]), pytest.raises(native.ShapeError):
        native.build(vertices, triangles + 1000)


def test_threads_of_others_keep_a_mode_each() -> None:
    vertices, triangles, origins, directions = small()
    built = native.build(vertices, triangles, "bvh-sah")
    start = threading.Barrier(len(MODES))

    def work(value: int) -> list[bytes]:
        start.wait()
        with within(value):
            return [packed(built.closest(origins, directions, threads=1 + n % 2)) for n in range(40)]

    expected = packed(built.closest(origins, directions))
    with ThreadPoolExecutor(len(MODES)) as pool:
        answers = list(pool.map(work, MODES.values()))
    assert {answer for some in answers for answer in some} == {expected}


@pytest.mark.parametrize("failing", ["call", "nothing"])
def test_a_mode_that_cannot_be_set_is_an_error(failing: str, monkeypatch: pytest.MonkeyPatch) -> None:
    class Library:
        """A C library that sets no mode."""

        def __init__(self, _: object) -> None:
            if failing == "call":
                raise OSError("no such library")

        fegetenv = fesetenv = staticmethod(lambda *_: 0)

    vertices, triangles, origins, directions = small()
    built = native.build(vertices, triangles)
    with within(MODES["both"]), monkeypatch.context() as patch:
        patch.setattr(ctypes, "CDLL", Library)
        with pytest.raises(RuntimeError, match="floating-point mode cannot be set: "):
            built.closest(origins, directions)


def process(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


PATHS = f"import ctypes, os, sys\nsys.path[:0] = {sys.path!r}\n"
SETTING = f"""{PATHS}
library, environment = ctypes.CDLL("libm.so.6"), (ctypes.c_uint32 * 8)()
library.fegetenv(environment)
environment[7] |= 0xE040
library.fesetenv(environment)
"""
"""Flush-to-zero, and rounding towards zero, before any other import."""

TRACING = """
import numpy as np
import halfspace_native as native
# Integers: NumPy computes in the mode too.
vertices = np.arange(900).reshape(-1, 3) ** 3 % 877 - 400.0
built = native.build(vertices, np.arange(300).reshape(-1, 3), "kd")
def digest():
    hits = built.closest(vertices / 4, vertices[::-1] - vertices / 4, threads=2)
    return hash((hits.t.tobytes(), hits.u.tobytes(), hits.triangle.tobytes()))
"""

FORK = """
child = os.fork()
if not child:
    print(digest(), flush=True)
    os._exit(0)
os.waitpid(child, 0)
print(digest())
"""


def test_a_module_that_is_imported_in_another_mode(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONHASHSEED", "0")
    assert process(f"{SETTING}{TRACING}print(digest())") == process(f"{PATHS}{TRACING}print(digest())")


def test_a_forked_process_traces_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONWARNINGS", "ignore")
    monkeypatch.setenv("PYTHONHASHSEED", "0")
    child, parent = process(f"{PATHS}{TRACING}digest()\n{FORK}").split()
    assert child == parent


INTERRUPTED = """
import signal, threading, time
def mode():
    library.fegetenv(environment)
    return environment[7] & 0xE040
expected, caught = digest(), 0
for n in range(60):
    timer = threading.Timer(n / 5000, os.kill, [os.getpid(), signal.SIGINT])
    try:
        timer.start()
        while True:
            assert digest() == expected
    except KeyboardInterrupt:
        caught += 1
    assert mode() == 0xE040, hex(mode())
    assert digest() == expected
print(caught)
"""


@pytest.mark.parametrize("setting", [SETTING, f"{SETTING}environment[7] &= ~0xE040\nlibrary.fesetenv(environment)\n"])
def test_an_interrupt_at_any_moment_leaves_the_mode(setting: str) -> None:
    program = f"{setting}{TRACING}{INTERRUPTED}"
    if setting != SETTING:
        program = program.replace("mode() == 0xE040", "mode() == 0")
    assert process(program) == "60"
