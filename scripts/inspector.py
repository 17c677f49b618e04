# SPDX-License-Identifier: GPL-3.0-or-later
"""The inspector as a page: `scripts/halfspace.py inspector`."""

import runpy
import sys
from pathlib import Path

# Inside Blender, everything before "--" is Blender's own.
sys.argv.insert(sys.argv.index("--") + 1 if "--" in sys.argv else 1, "inspector")
runpy.run_path(str(Path(__file__).with_name("halfspace.py")), run_name="__main__")
