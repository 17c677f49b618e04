# SPDX-License-Identifier: GPL-3.0-or-later
"""What the project depends on: the licences that it may use, and where packages come from."""

from __future__ import annotations

import dependencies


def test_a_dependency_that_may_not_be_used_is_named() -> None:
    own = {"name": "own", "version": "1", "license": "MIT", "source": None}
    any_version = {"name": "loose", "req": "*", "source": dependencies.REGISTRY}
    theirs = {"version": "2", "source": dependencies.REGISTRY, "dependencies": []}
    packages = [
        {**own, "dependencies": [any_version]},
        {**theirs, "name": "good", "license": "MIT OR Apache-2.0"},
        {**theirs, "name": "bad", "license": None},
        {**theirs, "name": "elsewhere", "license": "MIT", "source": "git+https://example.org/x"},
    ]
    found = list(dependencies.problems({"packages": packages}))
    assert [sentence.split(":")[0] for sentence in found] == ["own 1", "bad 2", "elsewhere 2"]
    assert "any version of loose" in found[0]
