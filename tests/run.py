# SPDX-License-Identifier: GPL-3.0-or-later
"""Run pytest and end the process at once: `python tests/run.py PYTEST-ARGUMENTS...`.

Blender 4.5 as a module hangs when Python ends after a render with a Python engine; leaving by `os._exit` avoids it.
"""

import os
import signal
import sys
import tempfile

if __name__ == "__main__":
    # A shell that starts this in the background has it ignore Ctrl-C, and all processes that it starts.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # Before bpy is imported: tests must neither read nor write the settings of the user's own Blender.
    with tempfile.TemporaryDirectory(prefix="halfspace-blender-") as resources:
        os.environ["BLENDER_USER_RESOURCES"] = resources
        import pytest

        status = int(pytest.main(sys.argv[1:]))
    sys.stdout.flush()
    os._exit(status)
