"""Relative errors, and the message about outputs that miss the accuracy."""

import numpy as np

from mdr_dask.models.parts.accuracy import missed, missed_accuracy, relative_errors


def test_the_sentence_names_what_misses_and_no_number_reads_as_the_accuracy():
    assert missed({"film": 0.01, "pressure": np.nan}, 0.01) == ""
    text = missed({"film": 0.2, "pressure": 0.010001, "traction": np.inf, "position": 0.003}, 0.01, " on 9 nodes")
    assert text == (
        "an accuracy of 0.01 is missed on 9 nodes: film by 0.2, pressure by 0.010001, traction by an unknown amount "
        "(estimated)"
    )


def test_errors_are_relative_to_the_largest_value_or_to_the_floor():
    values = {"film": [2.0, 0.0], "profile": [[1.0, np.nan, -4.0], [0.0, 0.0, 0.0]], "share": [0.1, 5.0]}
    errors = {"film": [0.1, 0.0], "profile": [[0.2, 9.0, 0.4], [0.0, 0.1, 0.0]], "share": [0.1, 0.1]}
    found = relative_errors(values, errors, {"share": 1.0})
    assert found["film"].tolist() == [0.05, 0.0]
    assert found["profile"].tolist() == [0.1, np.inf]
    assert found["share"].tolist() == [0.1, 0.02]
    assert list(missed_accuracy(values, errors, 0.1, {"share": 1.0})) == [1]
