"""Helpers for arrays."""

import pickle

import numpy as np
from numpy.testing import assert_array_equal

from brachis.common.arrays import LastCall, clear_rounding

CALLS = []


def double(values):
    CALLS.append(values)
    return 2.0 * values


def test_the_last_call_is_remembered_and_no_other():
    remembered = LastCall(double)
    first = np.array([1.0, 2.0])
    CALLS.clear()
    assert_array_equal(remembered(first), [2.0, 4.0])
    assert remembered(first.copy()) is remembered(first)
    assert len(CALLS) == 1
    assert_array_equal(remembered(first + 1.0), [4.0, 6.0])
    assert_array_equal(remembered(first), [2.0, 4.0])
    assert len(CALLS) == 3


def test_what_was_computed_last_is_not_sent_to_other_processes():
    remembered = LastCall(double)
    large = np.zeros(10_000)
    remembered(large)
    assert len(pickle.dumps(remembered)) < 1000


def test_rounding_errors_are_shown_as_zeros_and_small_values_as_they_are():
    values = np.array([-7.7e-18, 1e-9, -0.0])
    assert list(map(str, clear_rounding(values).tolist())) == ["0.0", "1e-09", "0.0"]
