# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's Blender: `python -I inside MODULE SCENARIO ARGUMENT ...`, with nothing of this repository but this folder.

Runs a function of a module of the folder, prints what it found as one JSON line, and ends the process.
"""

import importlib
import json
import os
import sys
import traceback

if __name__ == "__main__":
    try:
        scenario = getattr(importlib.import_module(sys.argv[1]), sys.argv[2])
        print("FOUND " + json.dumps(scenario(*sys.argv[3:])))
        status = 0
    except BaseException:
        traceback.print_exc()
        status = 1
    sys.stdout.flush()
    sys.stderr.flush()
    # Blender 4.5 as a module hangs at the interpreter's end after a render.
    os._exit(status)
