# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurements that explain times: errors against time, and the statistics of a structure."""
