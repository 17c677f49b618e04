# SPDX-License-Identifier: GPL-3.0-or-later
"""The lowest room: the native module, one line for errors, files, memory, colours."""
