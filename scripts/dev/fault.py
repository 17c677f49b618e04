# SPDX-License-Identifier: GPL-3.0-or-later
"""A deliberate fault, and the tests that notice several of them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """A fault: in `file`, the expression `old` is replaced by `new`, and `test` (program and name) must fail."""

    what: str
    file: str
    old: str
    new: str
    test: tuple[str, str]

    @property
    def is_rust(self) -> bool:
        """Whether it is in the native module, where a switch selects it."""
        return self.file.startswith("native/")


ALL = ("contract", "every_structure_answers_like_brute_force")
"""Every structure on every extreme case."""

EXACT = ("contract", "brute_force_answers_like_exact_arithmetic")
"""Brute force against exact arithmetic: faults that all structures share."""

ENDS = ("contract", "the_ray_interval_is_closed")
PACKETS = ("packets", "packets_lose_nothing_on_hard_scenes")
AFAR = ("lib", "candidates::tests::no_tiny_triangle_is_rejected_from_afar")
AFAR_BEAMS = ("lib", "lanes::tests::no_tiny_triangle_is_rejected_from_afar")
BLOCK = ("lib", "candidates::tests::no_hit_is_ever_rejected")
VERDICT = ("lib", "verdict::tests")
INTEGERS = ("lib", "exact")
BEAMS = ("beams", "pixels_are_those_of_single_rays_at_every_size")
STABILITY = ("tests/core/lab/test_stability.py", "lie")
