# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures and tables of a benchmark for papers: PDF, PGF and LaTeX."""
