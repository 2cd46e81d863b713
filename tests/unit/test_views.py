"""What is written past h5py's own layer is what that layer writes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from pbem.results.layout import count_steps
from pbem.results.opening import read_array
from pbem.results.views import Columns, create_array, create_group, create_growing, set_attribute, set_texts


@pytest.mark.parametrize("value", [
    "", "Müller", True, 3, -2.5, np.int32(4), np.array([1.5, -0.0]), np.zeros((2, 0)),
])  # fmt: skip
def test_attributes_are_those_of_h5py(value: Any, tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for mine in (0, value):  # the second in place of the first
            set_attribute(file.id, "mine", mine)
        file.attrs["other"] = value
        expect_same(file, value)


@pytest.mark.parametrize("texts", [[], ["a"], ["", "b", "ü"]])
def test_lists_of_texts_are_those_of_h5py(texts: list[str], tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        set_texts(file.id, "mine", tuple(texts))
        file.attrs["other"] = np.array(texts, dtype=h5py.string_dtype())
        expect_same(file, texts)


def expect_same(file: h5py.File, value: Any) -> None:
    mine, other = (file.attrs.get_id(name) for name in ("mine", "other"))
    assert (mine.get_type(), mine.shape) == (other.get_type(), other.shape)
    np.testing.assert_array_equal(file.attrs["mine"], value)


@pytest.mark.parametrize("shape", [(), (3,), (2, 2)])
def test_rows_that_grow_are_those_of_h5py(shape: tuple[int, ...], tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        create_growing(create_group(file.id, "g"), "mine", shape, np.dtype("f8"), 4)
        file.create_dataset("other", shape=(0, *shape), maxshape=(None, *shape), dtype="f8", chunks=(4, *shape))
        mine, other = file["g/mine"], file["other"]
        for each in (mine, other):
            each.resize(2, axis=0)
            each[1] = 7.0
        assert (mine.id.get_type(), mine.maxshape, mine.chunks) == (other.id.get_type(), other.maxshape, other.chunks)
        np.testing.assert_array_equal(mine[...], other[...])


@pytest.mark.parametrize("name", ["seam", "Naht über"])
def test_names_are_of_the_characters_that_h5py_says(name: str, tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_group("g").create_group(name)
        source = Columns(create_growing(file.id, "source", (2,), np.dtype("f8"), 4))
        for group, create in (
            ("a", lambda parent: create_group(parent, name)),
            ("b", lambda parent: create_growing(parent, name, (3,), np.dtype("f8"), 4)),
            ("c", lambda parent: create_array(parent, name, np.arange(3))),
            ("d", lambda parent: source.create_view(parent, name, 1)),
        ):
            create(create_group(file.id, group))
            mine, other = (file.id.links.get_info(f"{each}/{name}".encode()).cset for each in (group, "g"))
            assert mine == other, group


@pytest.mark.parametrize("values", [
    np.zeros((0, 2)), np.arange(6, dtype="i4"), np.arange(900.0).reshape(3, 300).T, np.array([1, 0], dtype="i1"),
])  # fmt: skip
def test_arrays_are_those_of_h5py(values: np.ndarray, tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        create_array(file.id, "mine", values)
        file["other"] = values
        assert file["mine"].id.get_type() == file["other"].id.get_type()
        np.testing.assert_array_equal(file["mine"][...], values)


@pytest.mark.parametrize("values", [np.zeros((0, 3)), np.arange(6, dtype="i4"), np.arange(6.0).reshape(2, 3)])
def test_arrays_are_read_as_by_h5py(values: np.ndarray, tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("g/a", data=values, maxshape=(None, *values.shape[1:]))
        for name, group in (("g/a", file), ("a", file["g"])):
            found = read_array(group, name)
            assert (found.dtype, found.shape) == (file["g/a"].dtype, file["g/a"].shape)
            np.testing.assert_array_equal(found, values)
        with pytest.raises(KeyError):
            read_array(file, "b")


def test_steps_are_those_of_the_shortest_of_what_grows(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for path, count in (("steps/number", 5), ("all/contact/slip", 4), ("all/reactions", 6), ("contact/a/slip", 0)):
            file.create_dataset(path, (count, 2), "f8", maxshape=(None, 2))
        file.create_dataset("all/contact/node", data=np.arange(2))
        file.create_dataset("convergence", (1,), "f8", maxshape=(None,))
        assert count_steps(file) == 4
        file["all/reactions"].resize(3, axis=0)
        assert count_steps(file) == 3
