# SPDX-License-Identifier: GPL-3.0-or-later
"""What needs no other room: the native module, one line for errors, files, memory, colours."""
