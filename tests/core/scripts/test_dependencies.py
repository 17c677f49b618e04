# SPDX-License-Identifier: GPL-3.0-or-later
"""Dependencies of the native module: licences, origin and limited versions; `cargo deny` checks more where it is."""

from __future__ import annotations

import json
import shutil
import subprocess
from typing import Any

import pytest

from scripts.dev import environment

REGISTRY = "registry+https://github.com/rust-lang/crates.io-index"
"""Cargo's name of the official registry, whichever mirror it downloads from."""

LICENCES = {
    *("(MIT OR Apache-2.0) AND Unicode-3.0", "Apache-2.0", "Apache-2.0 / MIT", "Apache-2.0 OR MIT"),
    *("Apache-2.0 WITH LLVM-exception", "Apache-2.0 WITH LLVM-exception OR Apache-2.0 OR MIT", "BSD-2-Clause"),
    *("BSD-2-Clause OR Apache-2.0 OR MIT", "GPL-3.0-or-later", "MIT", "MIT OR Apache-2.0"),
    *("MIT OR Apache-2.0 OR LGPL-2.1-or-later", "MIT/Apache-2.0", "Unlicense OR MIT", "Unlicense/MIT"),
    "Zlib OR Apache-2.0 OR MIT",
}
"""The expressions of packages so far, each of which `native/deny.toml` allows. Whoever adds one reads it."""


def problems(packages: list[Any]) -> set[str]:
    """Names of packages of `cargo metadata` that are not allowed, own ones whose requirements are not limited too."""
    return {
        one["name"]
        for one in packages
        if one["license"] not in LICENCES
        or one["source"] not in (None, REGISTRY)
        or (one["source"] is None and any(need["req"] == "*" and need["source"] for need in one["dependencies"]))
    }


@pytest.mark.skipif(shutil.which("cargo") is None, reason="Rust is not installed")
def test_every_dependency_may_be_used() -> None:
    words = "cargo metadata --manifest-path native/Cargo.toml --all-features --locked --offline --format-version 1"
    done = subprocess.run(words.split(), cwd=environment.ROOT, capture_output=True, text=True, check=True)
    packages = json.loads(done.stdout)["packages"]
    assert len(packages) > 50
    assert problems(packages) == set()
    for wrong in ({"license": None}, {"license": "SSPL-1.0"}, {"source": "git+https://example.org/x"}):
        assert problems([*packages, {**packages[0], "name": "wrong", **wrong}]) == {"wrong"}
    loose = {"req": "*", "source": REGISTRY}
    assert problems([{**packages[0], "name": "own", "license": "MIT", "source": None, "dependencies": [loose]}]) == {
        "own"
    }
