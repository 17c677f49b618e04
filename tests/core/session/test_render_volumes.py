# SPDX-License-Identifier: GPL-3.0-or-later
"""Volumes through the native module: every structure and every number of threads renders the same picture."""

import halfspace_native as native
import numpy as np
import pytest

from tests.render_scenes import camera, finish, image, placed, settings

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
FACES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ],
    np.int32,
)
CLEAR = {"closures": [{"kind": "transparent", "color": 1.0}]}
RISING = (
    {"op": "coordinate", "kind": "object"},
    {"op": "channel", "args": (0,), "channel": 2},
    {"op": "math", "kind": "ADD", "args": (1, 1.0, 0.0)},
)
"""A coefficient that rises from 0 to 2 along the height of the outer cube."""

VARYING = {"closures": ({"scattering": 2, "absorption": 0.2, "anisotropy": 0.3},), "program": RISING}
UNIFORM = {"closures": ({"scattering": (0.5, 0.7, 0.9), "absorption": 0.1, "emission": 0.05},)}
LAMP = {"kind": "point", "to_world": placed(x=2, z=3), "power": (100.0, 80.0, 60.0), "radius": 0.2}
VIEW = camera(window=(-1.5, 1.5, -0.75, 0.75), to_world=placed(z=8))


def made(spec, volumes, **parts):
    """Cubes within each other, of half size 1, 0.5 and so on, with these volumes, in the light of world and lamp."""
    sizes = 0.5 ** np.arange(len(volumes))
    vertices = np.concatenate([CORNERS * size for size in sizes]).astype(np.float32)
    triangles = np.concatenate([FACES + 8 * k for k in range(len(volumes))])
    frame = {"to_object": np.eye(4)[:3].tolist(), "generated": [[0.0] * 3, [1.0] * 3]}
    numbers = np.repeat(np.arange(len(volumes)), len(FACES))
    return native.RenderScene(
        native.build(vertices, triangles, spec),
        materials=[{**CLEAR, "volume": volume} for volume in volumes],
        material_index=numbers.astype(np.int32),
        objects=[frame] * len(volumes),
        object_index=numbers.astype(np.uint32),
        **{"world": {"color": (0.3, 0.3, 0.3)}, "lights": [LAMP]} | parts,
    )


def rendered(scene, threads=1, **changes):
    job = native.render(scene, VIEW, settings(max_bounces=8, volume_bounces=8, **changes), threads=threads)
    return image(finish(job))


def test_every_structure_renders_the_same_volumes():
    first = rendered(made("brute", [UNIFORM, VARYING]))
    assert np.isfinite(first).all()
    assert first[:, :3].std() > 0.01
    for spec in ("kd", "bvh-sah", "octree-param", "bih", "obb", "bbox-gs", "bsp-wn", "grid"):
        assert np.array_equal(rendered(made(spec, [UNIFORM, VARYING]), threads=3), first), spec


def test_voxels_are_read_in_the_space_of_their_object():
    # A constant grid beyond the cube on all sides, and an object value that selects it.
    grid = {
        "values": np.full((2, 2, 2, 1), 0.75, np.float32),
        "to_index": [[0.25, 0, 0, 0.5], [0, 0.25, 0, 0.5], [0, 0, 0.25, 0.5]],
    }
    steps = ({"op": "coordinate", "kind": "object"}, {"op": "voxels", "args": (1.0, 0, 0.0)})
    volume = {"closures": ({"absorption": 1},), "program": steps}
    scene = made("kd", [volume], grids=[grid], lights=[])
    view = camera(window=(-0.5, 0.5, -0.25, 0.25))
    found = image(finish(native.render(scene, view, settings(samples=1024))))
    assert found[:, 0].mean() == pytest.approx(0.3 * np.exp(-1.5), rel=0.02)
    # Without such a grid, the third argument is the value.
    absent = {"closures": ({"absorption": 1},), "program": (steps[0], {"op": "voxels", "args": (7.0, 0, 0.0)})}
    assert rendered(made("kd", [absent], lights=[]))[:, 0].max() == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"closures": ({"scattering": "thick"},)}, "scattering"),
        ({"closures": ({"density": 1.0},)}, "density"),
        ({"closures": ({},) * 17}, "closures"),
        ({"closures": ({"absorption": 3},), "program": RISING}, "step"),
        (5, "volume"),
    ],
)
def test_invalid_volumes_are_named(changes, words):
    with pytest.raises(ValueError, match=words):
        made("kd", [changes])


def test_a_world_that_varies_and_wrong_grids_are_refused():
    with pytest.raises(ValueError, match="must not vary"):
        made("kd", [UNIFORM], world={"color": (1.0, 1.0, 1.0), "volume": VARYING})
    flat = {"values": np.zeros((2, 2), np.float32), "to_index": [[0.0] * 4] * 3}
    with pytest.raises(ValueError, match="grids"):
        made("kd", [UNIFORM], grids=[flat])
