"""Relative errors and the sentence about those that miss an accuracy: one for all models."""

import numpy as np

from mdr_dask.models.parts.accuracy import missed, share


def test_errors_are_over_their_values_and_beside_the_whole_where_these_are_zero_within_them():
    found = share([0.1, 0.1, 0.1, 0.0, 0.1, np.inf], [2.0, -0.05, 0.0, 0.0, 0.0, 1.0], [9.0, 4.0, 4.0, 4.0, 0.0, 4.0])
    assert np.array_equal(found, [0.05, 0.025, 0.025, 0.0, np.inf, np.inf])
    assert np.isnan(share(np.nan, 1.0))


def test_the_sentence_names_what_misses_and_no_number_reads_as_the_accuracy():
    assert missed({"film": 0.01, "pressure": np.nan}, 0.01) == ""
    told = missed({"film": 0.2, "pressure": 0.010001, "traction": np.inf, "position": 0.003}, 0.01, " on 9 nodes")
    assert told == (
        "an accuracy of 0.01 is missed on 9 nodes: film by 0.2, pressure by 0.010001, traction by an unknown amount "
        "(estimated)"
    )
