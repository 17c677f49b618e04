# SPDX-License-Identifier: GPL-3.0-or-later
"""The laboratory: experiments on structures that the installed extension does not contain."""
