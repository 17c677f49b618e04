# SPDX-License-Identifier: GPL-3.0-or-later
"""From the words of a command line to configurations."""

from __future__ import annotations

from typing import Any

import halfspace_native
import numpy as np
import pytest

from addon.core.choose import auto
from addon.core.measure import benchmark, preparation
from addon.core.session import preview
from addon.core.structures import catalogue, presets, specs
from addon.lab.bench import bench_presets
from addon.lab.claims import growth
from addon.lab.commands import compare
from addon.lab.stability import agreement
from scripts.dev import overlay_picture, pictures


def structure(name: str, family: str, **defaults: Any) -> dict[str, Any]:
    parameters = [{"name": key, "default": value} for key, value in defaults.items()]
    return {"id": name, "family": family, "parameters": parameters}


REGISTRY = [
    structure("kd", "space", traversal="ta-b"),
    structure("bsp-random", "sweep", k=10, alpha=0.1, seed=0),
    structure("bsp-wn", "sweep", k=6, seed=0),
    structure("brute", "oracle"),
]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("kd,brute", ["kd", "brute"]),
        ("kd:traversal=dir,robust=none,brute", ["kd:traversal=dir,robust=none", "brute"]),
        (" kd , bsp-wn:k=3,seed=1 ,kd:traversal=dir", ["kd", "bsp-wn:k=3,seed=1", "kd:traversal=dir"]),
        ("", []),
    ],
)
def test_commas_inside_a_configuration_do_not_separate(text: str, expected: list[str]) -> None:
    assert specs.split(text) == expected


def test_ranges_of_numbers() -> None:
    assert specs.numbers("2..4") == ["2", "3", "4"]
    assert specs.numbers("2-4,8,0.5") == ["2", "3", "4", "8", "0.5"]
    for wrong in ("4-2", "x", "1,,2", ""):
        with pytest.raises(specs.SpecError):
            specs.numbers(wrong)


def test_all_and_families() -> None:
    assert specs.expand("all", REGISTRY, {}) == ["kd", "bsp-random", "bsp-wn", "brute"]
    assert specs.expand("sweep,kd", REGISTRY, {}) == ["bsp-random", "bsp-wn", "kd"]
    assert specs.expand("brute,kd,kd,all", REGISTRY, {}) == ["brute", "kd", "bsp-random", "bsp-wn"]


KINDS = [f"bsp-{kind}{more}" for kind in ("random", "wn", "cn") for more in ("", "-plus", "-plus-kd")]
SOURCES = f"""
brute kd kd-sah kd-median kd-object bsp-ize bsp-ize-kd bvh-sah bbox-gs bbox-gs-bnb grid rbsp:k=13 rbsp-kd:k=13
{" ".join(KINDS)} bsp-random:k=10 bsp-wn:k=6 bsp-cn-axial-plus-kd bsp-wn-area-plus-kd bsp-hybrid-plus-kd
bih skd boxtree bih:split=middle bih:split=median bih:split=sah bih5 bih5:cut=split bih1 bih4 bih-n:n=4 bih-sah bih-bvh
bih-obl beam-hh octree-glassner octree-arvo octree-param octree-samet octree-net octree-beam octree-net:shadow=beam
kd:traversal=ta-a kd:traversal=ta-b kd:traversal=sung kd:traversal=arvo kd:traversal=dir kd:traversal=tile
kd:traversal=tile16 kd:traversal=seq kd:traversal=rope kd:traversal=ropetree kd-median:traversal=seq
kd-median:traversal=rope kd-median:traversal=ropetree kd:traversal=packet4 kd:traversal=packet8 kd:traversal=packet
rbsp:traversal=packet4 bsp-ize-kd:traversal=packet8 bvh-sah:traversal=packet rbsp:traversal=projected
rbsp-kd:set=random,traversal=projected rbsp:traversal=ta-b-poly bsp-wn-plus-kd:traversal=ta-b-poly kd:shadow=cache
""".split()
"""The names of the papers' structures here."""


def test_every_name_of_the_sources_is_accepted() -> None:
    rows = halfspace_native.structures()
    corners, triangle = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32)
    for name in SOURCES:
        (spec,) = specs.expand(name, rows, {})
        assert spec.partition(":")[0] in {row["id"] for row in rows}
        assert halfspace_native.build(corners, triangle, name).validate() == []
    assert specs.expand("skd,boxtree:leaf_size=2", rows, {}) == ["bih", "bih:leaf_size=2"]
    assert specs.expand("bih4:leaf_size=2|3", rows, {}) == ["bih-n:n=2,leaf_size=2", "bih-n:n=2,leaf_size=3"]
    sweep = specs.expand("bsp-sweep", rows, {})
    assert {"bsp-random", "bsp-wn-plus-kd", "bsp-cn-axial-plus-kd", "bsp-hybrid-plus-kd"} < set(sweep)
    assert not {"bsp-ize", "kd", "rbsp"} & set(sweep)


NAMED = {
    "auto.TREES": auto.TREES,
    "agreement.REFERENCE": [agreement.REFERENCE],
    "preparation.TRACERS": preparation.TRACERS,
    "preview.QUICK": [spec for _, spec in preview.QUICK],
    "benchmark.BASES": benchmark.BASES,
    **{f"bench_presets.PRESETS[{name!r}]": [preset["structures"]] for name, preset in bench_presets.PRESETS.items()},
    "growth.SPECS": growth.SPECS,
    "pictures": [*pictures.STRUCTURES, pictures.BEAM, *pictures.BESIDE],
    "compare --structure": [compare.parser().get_default("structure")],
    "overlay_picture --structure": [overlay_picture.parser().get_default("structure")],
}
"""The configurations that the project itself builds, by their places. Claims are measured in `test_claims`, TICKED in
Blender.
"""


@pytest.mark.parametrize("place", NAMED)
def test_every_configuration_that_the_project_asks_for_exists(place: str) -> None:
    # Some of these places leave out what they do not find, and nobody would miss it.
    assert NAMED[place]
    for written in NAMED[place]:
        assert specs.prove(halfspace_native, specs.expand(written, halfspace_native.structures(), {}))


def test_ranges_apply_where_the_parameter_exists_and_is_not_given() -> None:
    made = specs.expand("kd,bsp-wn,bsp-random:k=3", REGISTRY, {"k": ["2", "4"], "seed": ["1"]})
    assert made == ["kd", "bsp-wn:k=2,seed=1", "bsp-wn:k=4,seed=1", "bsp-random:k=3,seed=1"]


def test_a_configuration_with_ranges_stands_for_several() -> None:
    made = specs.expand("kd,bsp-random:k=2..3,alpha=0.1|0.5,seed=7", REGISTRY, {})
    assert made == ["kd", *(f"bsp-random:k={k},alpha={a},seed=7" for k in (2, 3) for a in ("0.1", "0.5"))]
    assert specs.expand("kd:traversal=dir|ta-b", REGISTRY, {}) == ["kd:traversal=dir", "kd:traversal=ta-b"]
    assert specs.expand("bsp-wn:k=2..3", REGISTRY, {"seed": ["1", "2"], "k": ["9"]}) == [
        *(f"bsp-wn:k={k},seed={seed}" for k in (2, 3) for seed in (1, 2)),
    ]
    for wrong in ("bsp-wn:k=4..2", "bsp-wn:k=2..x", "bsp-wn:k=1..1000000", "bsp-wn:k=1..999,seed=1..999"):
        with pytest.raises(specs.SpecError):
            specs.expand(wrong, REGISTRY, {})


def test_unknown_names_are_told_with_what_there_is() -> None:
    with pytest.raises(specs.SpecError, match="unknown structure 'octopus'; there are kd, bsp-random"):
        specs.expand("kd,octopus", REGISTRY, {})
    with pytest.raises(specs.SpecError, match="parameter 'k'"):
        specs.expand("kd,brute", REGISTRY, {"k": ["2"]})
    with pytest.raises(specs.SpecError, match="no structure"):
        specs.expand(",", REGISTRY, {})


def test_values_are_typed_and_include_defaults() -> None:
    assert specs.values("bsp-random:k=3,alpha=1", REGISTRY) == {"k": 3, "alpha": 1.0, "seed": 0}
    assert specs.values("kd:traversal=dir", REGISTRY) == {"traversal": "dir"}


def test_values_out_of_a_structure_s_range_are_left_out_and_listed() -> None:
    plain = structure("plain", "sweep", k=6)
    plus = structure("plus", "sweep", k=6)
    plain["parameters"][0] |= {"min": 1, "max": 32}
    plus["parameters"][0] |= {"min": 3, "max": 32}
    told: list[str] = []
    found = specs.expand("plain,plus", [plain, plus], {"k": ["2", "3"]}, told)
    assert found == ["plain:k=2", "plain:k=3", "plus:k=3"]
    assert told == ["plus: k=2: it goes from 3 to 32"]
    with pytest.raises(specs.SpecError, match="plus: k=2"):
        specs.expand("plus", [plus], {"k": ["2"]})


def test_values_without_number_are_counted_before_configurations_are_made_of_them() -> None:
    many = specs.numbers("0-99999")
    # Some 10^10 steps, if each value were looked for among the others, or each configuration made.
    with pytest.raises(specs.SpecError, match="more than 100,000 configurations"):
        specs.expand("all", halfspace_native.structures(), {"seed": many})
    told: list[str] = []
    assert len(specs.expand("rbsp-kd", halfspace_native.structures(), {"k": many}, told)) == 24
    assert told == [f"rbsp-kd: k=0,1,2,{','.join(map(str, range(27, 44)))} and 99956 more: it goes from 3 to 26"]


def test_lists_are_counted_while_they_grow() -> None:
    every = halfspace_native.structures()
    with pytest.raises(specs.SpecError, match="more than 100,000 values"):
        specs.numbers(",".join(["0-99999"] * 2000))
    with pytest.raises(specs.SpecError, match="more than 100,000 values"):
        specs.expand("kd:leaf_size=" + "|".join(["0..99999"] * 2000), every, {})
    with pytest.raises(specs.SpecError, match="more than 100,000 configurations"):
        specs.expand(",".join(["kd:leaf_size=0..99999"] * 2000), every, {})
    # Some 10^10 steps each, if the values were judged for each configuration of the same structure, or to the end.
    for name in ("seed", "k"):
        with pytest.raises(specs.SpecError, match="more than 100,000 configurations"):
            specs.expand("bsp-random:alpha=0..99999", every, {name: specs.numbers("0-99999")})
    words = r"^none of the structures kd:leaf_size=0, .* and 99980 more has the"
    with pytest.raises(specs.SpecError, match=words) as told:
        specs.expand("kd:leaf_size=0..99999", every, {"k": ["3"]})
    assert len(str(told.value)) < 1000


def test_repeated_values_are_one_configuration_and_count_once() -> None:
    many = specs.numbers("1-60000")
    made = specs.expand("bsp-random", REGISTRY, {"seed": many, "k": ["2", "2"]})
    assert made == [f"bsp-random:seed={seed},k=2" for seed in many]
    made = specs.expand("bsp-random:k=2|2,seed=1..60000", REGISTRY, {})
    assert made == [f"bsp-random:k=2,seed={seed}" for seed in many]
    assert specs.expand("bsp-wn", REGISTRY, {"k": ["3", "2", "3", "4", "2"]}) == [f"bsp-wn:k={k}" for k in (3, 2, 4)]


def test_a_configuration_in_other_words_is_the_same() -> None:
    asked = "kd:,kd,kd:traversal=auto,kd:traversal=dir,kd:traversal=dir"
    written = specs.expand(asked, halfspace_native.structures(), {})
    assert written == ["kd", "kd:traversal=auto", "kd:traversal=dir"]
    assert specs.prove(halfspace_native, written) == ["kd", "kd:traversal=dir"]
    assert specs.prove(halfspace_native, ["kd:traversal=auto", "kd"]) == ["kd:traversal=auto"], "as it was written"
    with pytest.raises(specs.SpecError, match="kd:colour=3: "):
        specs.prove(halfspace_native, ["kd", "kd:colour=3"])


def test_settings_of_blender_take_a_key_once_as_the_native_module_does() -> None:
    known = catalogue.load()
    assert presets.settings(known, "kd:traversal=dir")[1]["traversal"] == "dir"
    with pytest.raises(specs.SpecError, match="traversal is given twice"):
        presets.settings(known, "kd:traversal=dir,traversal=sung")
