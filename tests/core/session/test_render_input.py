# SPDX-License-Identifier: GPL-3.0-or-later
"""Bad arguments of the renderer are refused, in one line that names them."""

import math

import halfspace_native as native
import numpy as np
import pytest

from tests.render_scenes import MATTE, POINT, camera, finish, placed, scene, settings


@pytest.mark.parametrize(
    ("words", "change"),
    [
        (r"settings\['width'\]", {"width": 0}),
        (r"settings\['samples'\].*-3", {"samples": -3}),
        (r"settings\['samples'\]: expected a whole number, got float", {"samples": 2.5}),
        (r"settings\['sampels'\] is not a key", {"sampels": 2}),
        (r"settings\['passes'\].*'Depht'", {"passes": ["Depht"]}),
        (r"settings\['border'\]", {"border": (0, 0, 9, 4)}),
        (r"settings\['border'\]", {"border": (0, 0, 9)}),
        (r"secondary_beams", {"secondary_beams": True}),
    ],
)
def test_rejects_bad_settings_in_one_line(words, change):
    with pytest.raises(native.SpecError, match=words) as caught:
        native.render(scene(), camera(), settings(**change))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("error", "words", "change"),
    [
        ("NonFiniteError", r"camera\['to_world'\]\[1\]\[3\]", {"to_world": placed(y=math.nan)}),
        ("ShapeError", r"camera\['to_world'\].*\(3, 3\)", {"to_world": np.eye(3)}),
        ("SpecError", r"camera\['kind'\].*fisheye", {"kind": "fisheye"}),
        ("SpecError", r"camera\['window'\] is empty", {"window": (0, 0, 0, 1)}),
        ("SpecError", "threads: expected a whole number from 0 to 1024", {}),
    ],
)
def test_rejects_bad_cameras_and_threads_in_one_line(error, words, change):
    with pytest.raises(getattr(native, error), match=words) as caught:
        native.render(scene(), camera(**change), settings(), threads=0 if change else -1)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("error", "words", "change"),
    [
        ("ShapeError", r"material_index\[1\]: 5 is out of range", {"material_index": np.array([0, 5], np.int32)}),
        ("ShapeError", "material_index: .* int32 array, got float64", {"material_index": np.zeros(2)}),
        ("ShapeError", "material_index must have .*: 2, got 3", {"material_index": np.zeros(3, np.int32)}),
        ("ShapeError", r"corner_normals.*\(2, 3\)", {"corner_normals": np.zeros((2, 3), np.float32)}),
        ("NonFiniteError", r"corner_normals\[0\]", {"corner_normals": np.full((2, 3, 3), np.inf, np.float32)}),
        ("SpecError", r"materials\[0\]\['ior'\].*'Matte'", {"materials": [MATTE | {"ior": 0.0}]}),
        ("SpecError", r"materials\[0\]\['rough'\] is not a key", {"materials": [MATTE | {"rough": 1}]}),
        ("SpecError", r"materials\[0\]: expected a dictionary", {"materials": ["red"]}),
        ("ShapeError", r"materials\[0\]\['base_color'\].*\(4,\)", {"materials": [{"base_color": (1, 1, 1, 1)}]}),
        ("NonFiniteError", r"lights\[0\]\['power'\]", {"lights": [POINT | {"power": (math.nan, 0, 0)}]}),
        ("SpecError", r"lights\[0\]\['kind'\].*laser", {"lights": [POINT | {"kind": "laser"}]}),
        ("SpecError", r"lights\[0\]\['shape'\] is missing", {"lights": [POINT | {"kind": "area"}]}),
        ("SpecError", r"lights\[0\]\['radius'\]", {"lights": [POINT | {"radius": -1}]}),
        ("NonFiniteError", r"world\['color'\]", {"world": {"color": (math.inf, 0, 0)}}),
    ],
)
def test_rejects_bad_scenes_in_one_line(error, words, change):
    with pytest.raises(getattr(native, error), match=words) as caught:
        scene(**change)
    assert "\n" not in str(caught.value)


def test_rejects_bad_buffers():
    job = finish(native.render(scene(), camera(), settings()))
    right = np.zeros(8 * 4 * 4, np.float32)
    frozen = right.copy()
    frozen.flags.writeable = False
    cases = [
        (right.astype(np.float64), "float64"),
        (right.reshape(4, -1), "one-dimensional"),
        (right[:-1], "128 elements, got 127"),
        (np.zeros(256, np.float32)[::2], "C-contiguous"),
        (frozen, "writable"),
        ([0.0] * 128, "got list"),
    ]
    for out, words in cases:
        with pytest.raises(native.ShapeError, match=words):
            job.copy_into("Combined", out)
    for name in ("Depth", "Depht"):
        with pytest.raises(native.SpecError, match=f"'{name}'"):
            job.copy_into(name, right)
    with pytest.raises(native.SpecError, match="milliseconds"):
        job.wait(-1)
