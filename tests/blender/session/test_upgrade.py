# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension is replaced by another version, or its process is ended, while a picture is being rendered."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]

UPGRADE = """
import sys, threading
import numpy as np
import bpy, addon, halfspace_native as native
from addon.blender.render import running

addon.register()
begun, log = threading.Event(), []
place = np.eye(4)
place[2, 3] = 4.0
camera = {
    "kind": "perspective", "to_world": place, "window": (-0.5, 0.5, -0.5, 0.5), "clip_start": 0.1, "clip_end": 100.0,
}

class Engine:
    "Stands for the engine of the old version."

def render():
    "A picture that would take hours, on a thread as Blender renders."
    corners = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], np.float32)
    scene = native.RenderScene(native.build(corners, np.array([[0, 1, 2]], np.int32)))
    job = native.render(scene, camera, {"width": 256, "height": 256, "samples": 1 << 20}, threads=1)
    engine = Engine()
    with running.picture(engine):
        begun.set()
        while not running.closing():
            assert not job.wait(10), "a million samples took no time"
        job.cancel()
        job.wait(600_000)
        log.append(job.cancelled)

thread = threading.Thread(target=render)
thread.start()
assert begun.wait(300)
old = addon
addon.unregister()
log.append("unregistered")
for name in [name for name in sys.modules if name == "addon" or name.startswith("addon.")]:
    del sys.modules[name]
import addon
assert addon is not old
addon.register()
thread.join()
assert log == [True, "unregistered"], log
scene = bpy.context.scene
scene.render.engine, scene.render.resolution_x, scene.render.resolution_y = "HALFSPACE", 16, 8
scene.halfspace.samples = 1
bpy.ops.render.render()
addon.unregister()
print("RENDERED AGAIN")
"""


def test_an_upgrade_ends_a_running_render_and_the_new_version_renders() -> None:
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-c", UPGRADE],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "RENDERED AGAIN" in done.stdout
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(os.name == "nt", reason="Windows ends processes without a signal")
def test_an_ended_process_leaves_the_old_picture(tmp_path: Path) -> None:
    picture = tmp_path / "out.png"
    picture.write_bytes(b"old")
    command = [sys.executable, str(ROOT / "scripts" / "render.py"), "--samples", str(1 << 20), "--out", str(picture)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        watchdog = threading.Timer(600, process.kill)
        watchdog.start()
        assert process.stdout is not None
        # Wait until samples are being rendered.
        for line in process.stdout:
            if "Sample " in line:
                process.send_signal(signal.SIGTERM)
                break
        process.stdout.read()
        status = process.wait()
        watchdog.cancel()
    assert status == -signal.SIGTERM
    assert picture.read_bytes() == b"old"
