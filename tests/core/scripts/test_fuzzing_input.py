# SPDX-License-Identifier: GPL-3.0-or-later
"""Files and command lines of every kind end in an answer or in one line that says why not."""

from __future__ import annotations

import functools
import io
import warnings
from collections.abc import Callable
from typing import Any

import halfspace_native
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from addon.core.scene import workload
from addon.lab.commands import bench
from addon.lab.commands import stability as stability_command

QUIET = settings(max_examples=120, suppress_health_check=list(HealthCheck))
GOOD: dict[str, Any] = {
    "vertices": np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32),
    "triangles": np.array([[0, 1, 2]], np.int32),
    "camera_eye": np.array([0.0, 0.0, 3.0]),
    "camera_target": np.zeros(3),
    "camera_up": np.array([0.0, 1.0, 0.0]),
    "camera_vfov_deg": np.float64(40.0),
}


def packed(save: Any = np.savez, **changes: Any) -> bytes:
    file = io.BytesIO()
    save(file, **{**GOOD, **changes})
    return file.getvalue()


WHOLE = packed()
PACKED = packed(np.savez_compressed)


def outcome(work: Callable[[], Any], refusal: type[Exception]) -> tuple[Any, str]:
    """The result of the work, or the words in which it was refused."""
    try:
        return work(), ""
    except refusal as error:
        return None, str(error)


def read(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.mktemp("scene") / "scene.npz"
    path.write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found, message = outcome(lambda: workload.load_npz(path, memory_limit=1 << 24), workload.WorkloadError)
    if found is None:
        assert "\n" not in message
        assert "scene" in message
    else:
        # What is read can be built.
        assert halfspace_native.build(found.vertices, found.triangles, "kd").validate() == []


@QUIET
@given(
    whole=st.sampled_from([WHOLE, PACKED]),
    changes=st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), max_size=6),
    end=st.one_of(st.just(1.0), st.floats(0, 1)),
    more=st.binary(max_size=20),
)
def test_a_damaged_file_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, whole: bytes, changes: Any, end: float, more: bytes
) -> None:
    content = bytearray(whole[: int(end * len(whole))])
    for place, value in changes:
        if content:
            content[int(place * len(content))] = value
    read(tmp_path_factory, bytes(content) + more)


@QUIET
@given(content=st.binary(max_size=400))
def test_any_bytes_are_refused(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    read(tmp_path_factory, content)


arrays = st.sampled_from(
    ["f4", "f8", "f2", "i4", "u4", "i8", "u8", "?", ">f4", ">i8", "c8", "S3", "U2", "M8[s]"]
).flatmap(
    lambda dtype: hnp.arrays(
        dtype, st.one_of(st.just((3, 3)), st.just((1, 3)), hnp.array_shapes(min_dims=0, max_side=4))
    )
)


@QUIET
@given(changes=st.dictionaries(st.sampled_from(sorted(GOOD)), arrays, max_size=3))
def test_arrays_of_any_kind_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, changes: Any) -> None:
    read(tmp_path_factory, packed(**changes))


@pytest.mark.parametrize("index", [2**31, 2**32, 2**32 + 1, 2**63 - 1])
def test_an_index_too_large_for_its_type_is_not_cut_off(tmp_path_factory: pytest.TempPathFactory, index: int) -> None:
    path = tmp_path_factory.mktemp("scene") / "scene.npz"
    path.write_bytes(packed(triangles=np.array([[0, 1, index]], np.int64)))
    with pytest.raises(workload.WorkloadError, match="out of range"):
        workload.load_npz(path)


word = st.one_of(
    st.text(max_size=8),
    st.from_regex(r"(kd|kd-sah|octree-net|space|all)?(:[a-z_]{0,9}=?[-+.0-9a-z]{0,12}(,[a-z_]{0,9}=[0-9.]{0,6})?)?"),
    st.from_regex(r"[0-9]{1,3}x[0-9²٣]{1,3}", fullmatch=True),
    st.from_regex(r"[0-9²]{0,12}-?[0-9]{0,12}(,[0-9]{1,3})?", fullmatch=True),
    st.sampled_from(["nan", "inf", "-1", "1e400", "9" * 5000, "0-99999999999", "primary", "\0", "²"]),
)
FLAGS = {
    bench: "--structures --k --alpha --seeds --rays --size --repeats --threads --curve --check-rays",
    stability_command: "--structures --long --seconds --seed --leak-rays --size",
}
WRONG = {bench: "not-there.npz", stability_command: "--threads=-1"}
"""Options that make every command line wrong; all else is read first."""


@pytest.mark.parametrize("command", FLAGS)
@QUIET
@given(data=st.data())
def test_any_command_line_ends_in_one_line(command: Any, data: Any, capsys: pytest.CaptureFixture[str]) -> None:
    # Equals signs, so that no text is taken for another option.
    flag = st.sampled_from(FLAGS[command].split())
    given = data.draw(st.lists(st.tuples(flag, word), max_size=4))
    assert command.main([*(f"{name}={text}" for name, text in given), WRONG[command]]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@QUIET
@given(text=st.text(max_size=30), structure=st.sampled_from(halfspace_native.structures()))
def test_any_configuration_is_understood_or_refused(text: str, structure: dict[str, Any]) -> None:
    build = functools.partial(halfspace_native.build, GOOD["vertices"], GOOD["triangles"])
    for spec in (text, f"{structure['id']}:{text}"):
        tree, message = outcome(functools.partial(build, spec), halfspace_native.SpecError)
        if tree is None:
            assert message.startswith("spec: ")
        else:
            assert tree.validate() == []
            assert build(tree.spec).spec == tree.spec
