# SPDX-License-Identifier: GPL-3.0-or-later
"""What the project depends on: the licences that it may use, and where packages come from."""

from __future__ import annotations

import dependencies
import pytest


@pytest.mark.parametrize(
    ("licence", "good"),
    [
        ("MIT", True),
        ("MIT/Apache-2.0", True),
        ("Unlicense OR MIT", True),
        ("(MIT OR Apache-2.0) AND Unicode-3.0", True),
        ("Apache-2.0 WITH LLVM-exception", True),
        ("MIT AND Unlicense", False),
        ("(MIT OR Unlicense) AND Zlib", False),
        ("Apache-2.0 WITH other-exception", False),
        ("MIT OR", False),
        ("MIT )", False),
        ("", False),
    ],
)
def test_licences_are_read_as_expressions(licence: str, good: bool) -> None:
    allowed = {"MIT", "Apache-2.0", "Unicode-3.0", "Apache-2.0 WITH LLVM-exception"}
    assert dependencies.may_be_used(licence, allowed) is good


def test_a_dependency_that_may_not_be_used_is_named() -> None:
    rules = {"licenses": {"allow": ["MIT"]}}
    own = {"name": "own", "version": "1", "license": "MIT", "source": None}
    any_version = {"name": "loose", "req": "*", "source": dependencies.REGISTRY}
    theirs = {"version": "2", "source": dependencies.REGISTRY, "dependencies": []}
    packages = [
        {**own, "dependencies": [any_version]},
        {**theirs, "name": "good", "license": "MIT OR Zlib"},
        {**theirs, "name": "bad", "license": None},
        {**theirs, "name": "elsewhere", "license": "MIT", "source": "git+https://example.org/x"},
    ]
    found = list(dependencies.problems({"packages": packages}, rules))
    assert [sentence.split(":")[0] for sentence in found] == ["own 1", "bad 2", "elsewhere 2"]
    assert "any version of loose" in found[0]
