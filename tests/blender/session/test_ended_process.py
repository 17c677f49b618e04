# SPDX-License-Identifier: GPL-3.0-or-later
"""The process is ended while a picture is being rendered."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.skipif(os.name == "nt", reason="Windows ends processes without a signal")
def test_an_ended_process_leaves_the_old_picture(tmp_path: Path) -> None:
    picture = tmp_path / "out.png"
    picture.write_bytes(b"old")
    command = [sys.executable, str(ROOT / "scripts" / "render.py"), "--samples", str(1 << 20), "--out", str(picture)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        watchdog = threading.Timer(600, process.kill)
        watchdog.start()
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
