# SPDX-License-Identifier: GPL-3.0-or-later
"""The plots of the benchmark's report, which need matplotlib, and the tables of the thesis next to its rows."""
