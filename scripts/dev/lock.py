# SPDX-License-Identifier: GPL-3.0-or-later
"""The lock files of the environments: `python -m scripts.dev.lock [--upgrade]`; options are those of `uv pip compile`.

uv resolves the dependency groups of pyproject.toml for all systems and writes requirements/*.txt: exact versions with
their hashes. It writes requirement files instead of uv.lock, which would contain the host of each package.
"""

import sys

from scripts.dev import environment

if __name__ == "__main__":
    for one in environment.ALL:
        words = ["pip", "compile", "--quiet", "--universal", "--generate-hashes", "--python-version", one.version]
        words += ["--custom-compile-command", "python -m scripts.dev.lock", "--output-file", str(one.lock)]
        words += [word for group in one.groups for word in ("--group", group)]
        try:
            environment.uv([*words, "pyproject.toml", *sys.argv[1:]], f"{one.lock.name} could not be made")
        except environment.SetupError as error:
            sys.exit(f"lock: {error}")
