# SPDX-License-Identifier: GPL-3.0-or-later
"""Hashes and metadata of Cryptomatte."""

from __future__ import annotations

import json

import numpy as np
import pytest

from addon.core.base import cryptomatte
from addon.core.scene.mattes import Mattes


@pytest.mark.parametrize(
    ("name", "value"),
    [("", 0), ("hello", 0x248BFA47), ("Hello, world!", 0xC0363E43), ("abcd", 0x43ED676A)],
)
def test_names_have_their_known_hashes(name: str, value: int) -> None:
    assert cryptomatte.murmur3(name) == value


def test_every_identity_is_a_normal_float() -> None:
    names = [f"object {number}" for number in range(20000)]
    found = cryptomatte.identities(names)
    assert np.isfinite(found).all()
    assert (np.abs(found) >= np.finfo(np.float32).tiny).all()
    # The rule changes only exponents that are not those of a normal number.
    same = found.view(np.uint32) == [cryptomatte.murmur3(name) for name in names]
    assert 0.98 < same.mean() < 1.0


def test_metadata_names_the_layer_and_everything_in_it() -> None:
    found = cryptomatte.metadata("View.CryptoObject", ['a "quoted" name', "Würfel", "Würfel"])
    (key,) = {name.rsplit("/", 1)[0] for name in found}
    assert key == f"cryptomatte/{cryptomatte.murmur3('View.CryptoObject'):08x}"[:-1]
    assert json.loads(found[f"{key}/manifest"]) == {
        name: f"{cryptomatte.identity(name):08x}" for name in ('a "quoted" name', "Würfel")
    }


def test_runs_have_the_identities_of_their_objects_and_assets() -> None:
    mattes = Mattes({"A [lib]": ("A", "Top")}, ("Paint",))
    found = mattes.arrays([(3, "A [lib]"), (1, "B")])
    expected = [[cryptomatte.identity(name) for name in row] for row in (("A", "Top"), ("B", "B"))]
    assert found["identities"].tolist() == expected
    assert found["material_identities"].tolist() == [cryptomatte.identity("Paint")]
    assert Mattes().arrays([])["identities"].shape == (0, 2)
