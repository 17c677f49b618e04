# SPDX-License-Identifier: GPL-3.0-or-later
"""Results of a benchmark as files, text, plots and HTML."""
