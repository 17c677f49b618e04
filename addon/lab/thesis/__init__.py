# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables and figures of Hoobergs 2019, measured again next to the published numbers."""
