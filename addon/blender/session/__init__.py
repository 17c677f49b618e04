# SPDX-License-Identifier: GPL-3.0-or-later
"""The last structure of each scene, its build and its report."""
