# SPDX-License-Identifier: GPL-3.0-or-later
"""The tests, and what they share."""
