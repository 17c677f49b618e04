# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `halfspace`: `halfspace COMMAND [options]`."""

from __future__ import annotations

import sys
from collections.abc import Sequence

OVERWRITTEN = (
    "halfspace: files of another project named halfspace replace some of the package halfspace-rt: "
    "uninstall both, then install halfspace-rt again"
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command. Returns its exit status, and 2 if another project has overwritten the package."""
    if not hasattr(sys.modules[__package__], "measure"):
        # The project `halfspace` of PyPI installs a module of the same name.
        print(OVERWRITTEN, file=sys.stderr)
        return 2
    from .lab.commands import launcher

    return launcher.main(sys.argv[1:] if arguments is None else arguments)


if __name__ == "__main__":
    sys.exit(main())
