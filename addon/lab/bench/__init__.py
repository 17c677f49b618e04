# SPDX-License-Identifier: GPL-3.0-or-later
"""Sweeps over configurations and scenes, in several processes or on a cluster."""
