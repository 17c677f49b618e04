# SPDX-License-Identifier: GPL-3.0-or-later
"""A floor under a lamp, seen from above, and its pictures: shared by tests of the renderer."""

import halfspace_native as native
import numpy as np


def placed(x=0.0, y=0.0, z=0.0):
    """(4, 4) matrix of a translation."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


FLOOR = (
    np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], np.float32),
    np.array([[0, 1, 2], [0, 2, 3]], np.int32),
)
MATTE = {"name": "Matte", "base_color": (0.8, 0.8, 0.8), "specular": 0.0}
POINT = {"kind": "point", "to_world": placed(z=2), "power": (100.0, 50.0, 0.0), "radius": 0.0}


def camera(**changes):
    """A parallel camera above the floor's centre, with these changes."""
    base = {
        "kind": "orthographic",
        "to_world": placed(z=8),
        "window": (-0.01, 0.01, -0.01, 0.01),
        "clip_start": 0.1,
        "clip_end": 100.0,
    }
    return base | changes


def settings(**changes):
    """Settings of a picture of 8 × 4 pixels, with these changes."""
    return {"width": 8, "height": 4, "samples": 4, "max_bounces": 0} | changes


def scene(spec="kd", **changes):
    """The floor under the lamp in this structure, with these changes of its materials and lights."""
    parts = {"materials": [MATTE], "lights": [POINT]} | changes
    return native.RenderScene(native.build(*FLOOR, spec), **parts)


def finish(job):
    """Wait for a job, check that it has no error, and return it."""
    assert job.wait(600_000)
    assert job.error is None
    return job


def image(job, name="Combined", pixels=32):
    """(pixels, channels) float32 of a pass."""
    out = np.full(pixels * job.passes[name], np.nan, np.float32)
    job.copy_into(name, out)
    return out.reshape(pixels, -1)
