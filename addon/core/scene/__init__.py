# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes as checked arrays, workloads and the rays of a view."""
