# SPDX-License-Identifier: GPL-3.0-or-later
"""The checkbox *Denoise*: final renders lose their noise, and nothing else changes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from addon.blender.render import engine
from addon.core.base import denoise
from tests.blender import atlas
from tests.blender.exr_files import colours, render
from tests.blender.shapes import cube, grid, lamp, look, place, world


@pytest.fixture
def stage(scene: Any) -> Any:
    """A cube on a floor in soft light, with much noise at two samples."""
    scene.render.engine, scene.halfspace.samples = engine.ENGINE, 2
    place("Cube", cube(), location=(0, 0, 1), rotation_euler=(0, 0, 0.6))
    place("Floor", grid(4), scale=(6, 6, 6))
    lamp("AREA", 800, size=4, location=(-3, -3, 6), rotation_euler=(0.5, -0.5, 0))
    look((96, 64), (0, -9, 4), 1.2)
    world()
    return scene


def rmse(a: Any, b: Any) -> float:
    return float(np.sqrt(np.mean((a - b) ** 2)))


@pytest.mark.parametrize("integrator", ["path", "ao"])
def test_the_error_falls_and_alpha_stays(stage: Any, tmp_path: Path, integrator: str) -> None:
    stage.halfspace.integrator = integrator
    stage.halfspace.samples = 1024
    reference = colours(render(stage, tmp_path))
    stage.halfspace.samples = 2
    stage.halfspace.render_seed = 5
    stage.render.film_transparent = True
    noisy = render(stage, tmp_path)
    stage.halfspace.use_denoising = True
    clean = render(stage, tmp_path)
    assert clean.keys() == noisy.keys(), "no pass appears that was not asked for"
    assert np.array_equal(clean["Combined.A"], noisy["Combined.A"])
    surface = noisy["Combined.A"] == 1
    before, after = (rmse(colours(p)[surface], reference[surface]) for p in (noisy, clean))
    assert after < 0.5 * before
    assert not atlas.warnings(stage)


def test_passes_that_guide_keep_their_values(stage: Any, tmp_path: Path) -> None:
    layer = stage.view_layers[0]
    layer.use_pass_normal = layer.halfspace.use_pass_albedo = True
    noisy = render(stage, tmp_path)
    stage.halfspace.use_denoising = True
    clean = render(stage, tmp_path)
    for name, values in noisy.items():
        assert np.array_equal(values, clean[name]) != name.startswith("Combined.") or name.endswith(".A"), name


def test_a_border_is_denoised_alone(stage: Any, tmp_path: Path) -> None:
    stage.halfspace.use_denoising = True
    render_ = stage.render
    render_.use_border = render_.use_crop_to_border = True
    render_.border_min_x, render_.border_max_x, render_.border_min_y, render_.border_max_y = 0.2, 0.7, 0.1, 0.9
    assert colours(render(stage, tmp_path)).std() > 0


def test_without_the_library_the_noise_stays_and_is_reported(
    stage: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    noisy = colours(render(stage, tmp_path))
    stage.halfspace.use_denoising = True

    def missing(_folders: Any) -> Any:
        raise denoise.DenoiseError("Open Image Denoise cannot be loaded: gone")

    monkeypatch.setattr(denoise, "load", missing)
    assert np.array_equal(colours(render(stage, tmp_path)), noisy)
    said = "The noise could not be removed: Open Image Denoise cannot be loaded: gone"
    assert any(said in line for line in atlas.warnings(stage))


def test_a_folder_without_the_library_gives_that_of_blender_itself(tmp_path: Path) -> None:
    assert denoise.load([tmp_path])
    (tmp_path / "libOpenImageDenoise.so.2").write_text("no library")
    (tmp_path / "OpenImageDenoise.dll").write_text("no library")
    assert denoise.load([tmp_path])


def test_the_reason_of_a_missing_library_is_short(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(name: str) -> Any:
        raise OSError(f"{name}: cannot be opened")

    monkeypatch.setattr(denoise.ctypes, "CDLL", refuse)
    with pytest.raises(denoise.DenoiseError, match=r"cannot be loaded: not found$"):
        denoise.load([tmp_path])
    (tmp_path / "libOpenImageDenoise.so.2").write_text("no library")
    with pytest.raises(denoise.DenoiseError, match=r"libOpenImageDenoise.so.2: cannot be opened$"):
        denoise.load([tmp_path])


def test_values_that_are_not_finite_do_not_spread() -> None:
    color = np.full((32, 32, 3), 0.5, np.float32)
    color[3, 4], color[9, 9] = np.nan, np.inf
    found = denoise.denoise(denoise.load([]), color)
    assert np.isfinite(found).all()
    assert found[20:, 20:].mean() == pytest.approx(0.5, abs=0.02)


def test_a_stopped_denoiser_returns_the_noise() -> None:
    color = np.random.default_rng(1).random((512, 512, 3), np.float32)
    assert denoise.denoise(denoise.load([]), color, keep_going=lambda: False) is color

    def interrupt() -> bool:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        denoise.denoise(denoise.load([]), color, keep_going=interrupt)


def test_features_are_added_once() -> None:
    assert denoise.with_features(("Combined", "Normal"), "path") == ("Combined", "Normal", "Denoising Albedo")
    assert denoise.with_features(("Combined",), "ao") == ("Combined",)
