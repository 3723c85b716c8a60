"""Indices mean what they mean to numpy."""

import numpy as np
import pytest
from conftest import SHAPE
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import wavesplat


@pytest.fixture(scope="module")
def pair(path, decoded):
    return wavesplat.open(path), decoded


def along(length):
    """A key along an axis: number, slice, list or mask."""
    number = st.integers(-length, length - 1)
    return st.one_of(
        number,
        st.slices(length),
        st.lists(number, max_size=6),
        hnp.arrays(bool, length),
    )


@settings(max_examples=150, deadline=None)
@given(key=hnp.basic_indices(SHAPE, allow_newaxis=True, allow_ellipsis=True))
def test_basic_indices(pair, key):
    file, decoded = pair
    got, expected = file[key], decoded[key]
    assert got.shape == np.shape(expected)
    assert got.dtype == file.dtype
    np.testing.assert_array_equal(got, expected)


@settings(max_examples=100, deadline=None)
@given(key=st.tuples(*map(along, SHAPE)))
def test_outer_indices(pair, key):
    file, decoded = pair
    expected = decoded
    for axis, part in reversed(list(enumerate(key))):
        part = np.array(part, dtype=int) if isinstance(part, list) else part
        expected = expected[(slice(None),) * axis + (part,)]
    np.testing.assert_array_equal(file.oindex[key], expected)
    np.testing.assert_array_equal(file.read(*key), expected)


@settings(max_examples=50, deadline=None)
@given(axis=st.integers(0, 3), data=st.data())
def test_one_list(pair, axis, data):
    file, decoded = pair
    part = data.draw(st.lists(st.integers(-SHAPE[axis], SHAPE[axis] - 1), min_size=1, max_size=8))
    key = (slice(None, None, 2),) * axis + (part,)
    np.testing.assert_array_equal(file[key], decoded[key])


@pytest.mark.parametrize(
    ("key", "words"),
    [
        (40, "out of bounds for axis 0 with size 40"),
        ((0, -21), "axis 1"),
        ((0, 0, 0, 0, 0), "too many"),
        ((..., ...), "one ellipsis"),
        ("a", "whole number"),
        (1.5, "whole number"),
        (([1], [2]), "oindex"),
        (np.zeros(39, bool), "mask along axis 0 has 40"),
        (np.zeros((2, 2), int), "whole number"),
    ],
)
def test_wrong_indices(pair, key, words):
    with pytest.raises(IndexError, match=words):
        pair[0][key]


def test_only_touched_blocks_are_read(path):
    file = wavesplat.open(path)
    opened = file.bytes_read
    corner = file[0, 0, 0, 0]
    one = file.bytes_read - opened
    assert corner.shape == ()
    ends = file.oindex[0, 0, 0, [0, SHAPE[3] - 1]]
    assert ends.shape == (2,)
    assert one < file.file_bytes / 4
    assert file.bytes_read - opened < file.file_bytes / 2


def test_repeated_items(pair):
    file, decoded = pair
    for key in ([0, 0, 2], [2, 0, 0, 1], [1, 1]):
        np.testing.assert_array_equal(file[3, key], decoded[3, key])
        np.testing.assert_array_equal(file[key, 3], decoded[key, 3])


def test_what_was_decoded_is_kept_as_far_as_it_may(path):
    for cache, is_read_again in (wavesplat._file.CACHE, False), (0, True):
        with wavesplat.open(path, cache=cache) as file:
            series = [file[:, 1, 2, 3], file[:, 1, 2, 3]]
            before = file.bytes_read
            series.append(file[:, 1, 2, 3])
            assert (file.bytes_read > before) == is_read_again
            np.testing.assert_array_equal(series[0], series[2])
    with pytest.raises(ValueError, match="cache: takes 0 or more"):
        wavesplat.open(path, cache=-1)
