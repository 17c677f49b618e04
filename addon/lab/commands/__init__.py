# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands, one module each: `parser()` is its command line, `main(arguments)` runs it and returns the status."""
