# SPDX-License-Identifier: GPL-3.0-or-later
"""Sessions against a fake native module: what is passed on, and how work is stopped."""

import math
import threading
from dataclasses import replace

import halfspace_native
import numpy as np
import pytest

from addon.core.scene.scene import Camera, Geometry, Light, Material, Scene, World
from addon.core.session.session import Cancelled, RenderError, Session, watch
from addon.core.structures.settings import RenderSettings
from tests.fake_native import FakeNative

SCENE = Scene(Geometry.empty(), (Material("grey"),), (), World())
CAMERA = Camera("perspective", np.eye(4), (-1.0, 1.0, -1.0, 1.0), 0.1, 100.0)
SETTINGS = RenderSettings(width=4, height=3)


def start(native: FakeNative) -> Session:
    return Session.start(native, SCENE, "kd", keep_going=lambda _progress: True)


def test_materials_and_world_reach_the_native_scene() -> None:
    session = start(FakeNative())
    parts = session.render_scene.parts
    assert parts["materials"][0]["name"] == "grey"
    assert parts["world"]["color"] == (0.0, 0.0, 0.0)
    assert parts["corner_normals"] is None
    assert parts["material_index"].dtype == np.int32
    assert session.left_out == ["shadow rays: no lights"]


def test_an_error_about_a_light_names_it() -> None:
    sound = Light("sun", np.eye(4), (1.0, 1.0, 1.0), name="Sun")
    lamp = Light("point", np.eye(4), (1e60, 1.0, 1.0), name="Desk Lamp")
    for lights, words in (
        ((sound, lamp), r"^Desk Lamp: lights\[1\]\['power'\]\[0\] must be finite"),
        ((replace(lamp, name=""),), r"^lights\[0\]"),
    ):
        with pytest.raises(halfspace_native.NonFiniteError, match=words):
            Session.start(halfspace_native, replace(SCENE, lights=lights), "kd", keep_going=lambda _: True)


def test_a_cancelled_build_stops_and_joins_its_thread() -> None:
    native = FakeNative(build_seconds=math.inf)
    with pytest.raises(Cancelled):
        Session.start(native, SCENE, "kd", keep_going=lambda _progress: False)
    assert native.monitor is not None
    assert native.monitor.cancelled
    assert not [thread for thread in threading.enumerate() if thread.name == "halfspace-build"]


def test_a_deleted_session_stops_its_build() -> None:
    native = FakeNative(build_seconds=math.inf)
    session = Session(native, SCENE.geometry, "kd")
    while native.monitor is None:
        assert not session.wait(0.01)
    del session
    assert native.monitor.cancelled
    for thread in threading.enumerate():
        if thread.name == "halfspace-build":
            thread.join(10)
            assert not thread.is_alive()


def test_a_finished_structure_is_used_in_place_of_a_build() -> None:
    native = FakeNative()
    built = start(native)
    session = Session(native, SCENE.geometry, "kd", structure=built.structure)
    assert session.wait(0)
    assert session.structure is built.structure
    session.show(SCENE)
    assert session.left_out == built.left_out
    assert native.builds == 1


def test_the_memory_limit_reaches_the_build() -> None:
    native = FakeNative()
    Session.start(native, SCENE, "kd", memory_limit=123, keep_going=lambda _progress: True)
    assert native.memory_limit == 123


def test_an_error_of_the_build_reaches_the_caller() -> None:
    with pytest.raises(ValueError, match="spec: unknown structure"):
        start(FakeNative(error=ValueError("spec: unknown structure 'x'")))


def test_a_render_shows_intermediate_pictures_and_ends() -> None:
    job = start(FakeNative(render_seconds=0.3)).render(CAMERA, SETTINGS)
    shown: list[float] = []
    watch(job, milliseconds=50, keep_going=lambda _progress: True, show=lambda: shown.append(job.progress))
    assert shown
    assert job.finished


def test_a_cancelled_render_stops() -> None:
    job = start(FakeNative(render_seconds=math.inf)).render(CAMERA, SETTINGS)
    with pytest.raises(Cancelled):
        watch(job, milliseconds=50, keep_going=lambda _progress: False, show=lambda: None)
    assert job.cancelled


def test_an_error_of_the_render_is_raised_with_its_own_words() -> None:
    job = start(FakeNative(job_error="out of memory")).render(CAMERA, SETTINGS)
    with pytest.raises(RenderError, match="out of memory"):
        watch(job, milliseconds=50, keep_going=lambda _progress: True, show=lambda: None)
