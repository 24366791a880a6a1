"""Numbers and names in sentences."""

import pytest

from brachis.common.words import name_first, write_apart, write_count


@pytest.mark.parametrize("count, text", [(0, "0 rows"), (1, "1 row"), (2, "2 rows")])
def test_counts_are_written_with_their_noun(count, text):
    assert write_count(count, "row") == text


def test_three_names_and_the_number_of_the_others():
    assert name_first(["a", "b", "c"], "; ") == "a; b; c"
    assert name_first(list("abcde"), "; ") == "a; b; c and 2 more"


def test_numbers_that_differ_are_written_with_different_digits():
    assert write_apart(1.00001, 1.0) == ("1.00001", "1")
    assert write_apart(2.0, 1.0) == ("2", "1")
