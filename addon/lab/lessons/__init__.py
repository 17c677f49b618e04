# SPDX-License-Identifier: GPL-3.0-or-later
"""Lessons for a class: small scenes, questions, and the numbers of their answers."""
