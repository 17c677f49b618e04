# SPDX-License-Identifier: GPL-3.0-or-later
"""Error and run time of acceleration structures, side by side: `scripts/halfspace.py bench`."""

import runpy
import sys
from pathlib import Path

# Inside Blender, everything before "--" is Blender's own.
sys.argv.insert(sys.argv.index("--") + 1 if "--" in sys.argv else 1, "bench")
runpy.run_path(str(Path(__file__).with_name("halfspace.py")), run_name="__main__")
