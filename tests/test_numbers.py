"""Numbers have the digits that their errors leave, and none where nobody knows them."""

import math

import pytest

from legfem.common.numbers import fit_probability, is_determined, number, probability, share, span


@pytest.mark.parametrize(
    ("value", "spread", "shown"),
    [
        (1.01893, 0.0017, "1.019"),
        (0.996, 0.038, "1.00"),
        (0.027634, math.nan, "0.028"),
        (844.2, math.nan, "840"),
        (3377.9, math.nan, "3,400"),
        (0.0, math.nan, "0"),
        (math.nan, 1.0, "-"),
        (1.9e-7, math.nan, "1.9e-07"),
    ],
)
def test_a_number_has_the_digits_that_its_error_leaves_and_two_without_one(value, spread, shown):
    assert number(value, spread) == shown


def test_chances_end_where_they_are_counted_and_shares_have_two_digits():
    assert fit_probability(1.9e-265) == "p < 0.0001" and fit_probability(0.0312) == "p = 0.031"
    assert probability(5e-4) == "p < 0.001" and probability(None) == "p unknown"
    assert share(0.05432) == "5.4 %" and share(33.779) == "3,400 %" and share(2.6e-6) == "below 0.01 %"


def test_an_interval_of_more_than_a_factor_of_ten_determines_nothing():
    assert is_determined(3.0, (1.0, 9.9)) and not is_determined(3.0, (1.0, 10.1))
    assert not is_determined(1.0, (0.0, 46.0)) and is_determined(0.5, (0.0, 0.9))
    assert is_determined(0.0, (0.0, 0.9)), "at most that much"
    assert is_determined(0.1, (-2.0, 3.0)) and is_determined(2.0, (1.5, math.inf))


def test_an_interval_at_a_bound_is_one_sided():
    assert span((0.02, 0.024), 0.001, "lower") == "at most 0.0240" and span((17.0, 30.0), 3.0, "upper") == "at least 17"
    assert span((1.5, math.inf), 0.2) == "at least 1.5" and span((0.97, 1.02), 0.01) == "0.970 to 1.020"
