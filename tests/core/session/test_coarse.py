# SPDX-License-Identifier: GPL-3.0-or-later
"""Coarse first pictures: they cover the whole part that is rendered, and each pixel has the colour at its place."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import halfspace_native
import numpy as np
import pytest

from addon.core.scene.scene import Camera, Geometry, Material, Scene, World
from addon.core.session import coarse
from addon.core.session.session import RenderError, Session
from addon.core.structures.settings import RenderSettings
from tests.fake_native import FakeNative

FLOOR = Geometry(
    np.array([[-9, -9, 0], [9, -9, 0], [9, 0, 0], [-9, 0, 0]], np.float32),
    np.array([[0, 1, 2], [0, 2, 3]], np.int32),
    np.zeros(2, np.int32),
)
SCENE = Scene(FLOOR, (Material("glowing", emission=(1.0, 0.5, 0.25)),), (), World((0.0, 0.0, 0.0)))
ABOVE = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 8], [0, 0, 0, 1]], float)
CAMERA = Camera("orthographic", ABOVE, (-8.0, 8.0, -4.5, 4.5), 0.1, 100.0)
SETTINGS = RenderSettings(width=800, height=450, samples=8, passes=("Combined", "Depth"))


def session() -> Session:
    return Session.start(halfspace_native, SCENE, "kd", keep_going=lambda _progress: True)


@pytest.mark.parametrize("border", [None, (100, 50, 733, 401)])
def test_the_pictures_cover_the_part_and_become_finer(
    border: tuple[int, int, int, int] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes: list[int] = []
    render = Session.render

    def recorded(self: Session, camera: Camera, settings: RenderSettings) -> Any:
        assert settings.samples == 1
        sizes.append(math.prod(settings.size))
        return render(self, camera, settings)

    monkeypatch.setattr(Session, "render", recorded)
    monkeypatch.setattr(coarse, "SECONDS", math.inf)  # the speed of this machine has no influence
    settings = replace(SETTINGS, border=border)
    width, height = settings.size
    found = list(coarse.pictures(session(), CAMERA, settings, lambda: True))
    assert len(found) == len(sizes) == 2
    assert sizes[0] < 1.2 * coarse.FIRST_PIXELS < sizes[1] < 1.2 * width * height / coarse.FINEST**2
    # The lower half of the frame is a light, the upper half is black.
    middle = SETTINGS.height // 2 - (border[1] if border is not None else 0)
    for one in found:
        picture = one.reshape(height, width, 4)
        assert (picture[: middle - 16, :, :3] > 0.2).all()
        assert (picture[middle + 16 :, :, :3] == 0).all()
        assert (picture[..., 3] == 1).all()


@pytest.mark.parametrize("side", [4, 8, 32])
@pytest.mark.parametrize("border", [None, (1, 2, 799, 449), (3, 5, 4, 6), (37, 100, 405, 222)])
def test_each_pixel_has_the_large_pixel_at_its_centre(border: tuple[int, int, int, int] | None, side: int) -> None:
    settings = replace(SETTINGS, border=border)
    large = coarse.enlarged(settings, side)
    x0, y0, x1, y1 = settings.border or (0, 0, settings.width, settings.height)
    left, low = large.border[:2] if large.border is not None else (0, 0)
    across, up = large.size
    # A picture whose colour is the position of the large pixel, in pixels of the frame.
    places = np.zeros((up, across, 4), np.float32)
    places[..., 0] = (np.arange(across) + left + 0.5) * settings.width / large.width
    places[..., 1] = ((np.arange(up) + low + 0.5) * settings.height / large.height)[:, None]
    found = coarse.spread(places, large, settings)
    assert found.shape == (y1 - y0, x1 - x0, 4)
    half_wide, half_high = settings.width / large.width / 2, settings.height / large.height / 2
    assert np.abs(found[..., 0] - (np.arange(x0, x1) + 0.5)).max() <= half_wide + 0.01
    assert np.abs(found[..., 1] - (np.arange(y0, y1) + 0.5)[:, None]).max() <= half_high + 0.01


def test_a_small_picture_has_none_and_a_stop_ends_them() -> None:
    assert not list(coarse.pictures(session(), CAMERA, replace(SETTINGS, width=64, height=36), lambda: True))
    slow = Session.start(FakeNative(render_seconds=math.inf), SCENE, "kd", keep_going=lambda _progress: True)
    assert not list(coarse.pictures(slow, CAMERA, SETTINGS, lambda: False))


def test_an_error_of_the_renderer_is_raised() -> None:
    broken = Session.start(FakeNative(job_error="it broke"), SCENE, "kd", keep_going=lambda _progress: True)
    with pytest.raises(RenderError, match="it broke"):
        list(coarse.pictures(broken, CAMERA, SETTINGS, lambda: True))


def test_a_slow_scene_has_only_the_first_picture() -> None:
    slow = Session.start(FakeNative(render_seconds=0.3), SCENE, "kd", keep_going=lambda _progress: True)
    assert len(list(coarse.pictures(slow, CAMERA, SETTINGS, lambda: True))) == 1
