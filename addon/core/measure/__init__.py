# SPDX-License-Identifier: GPL-3.0-or-later
"""Checked answers, counters and times of structures."""
