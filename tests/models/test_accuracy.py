"""The messages about outputs that miss the accuracy."""

import numpy as np

from mdr_dask.models.parts.accuracy import missed_accuracy


def test_the_message_names_what_misses():
    values = {"film": [1.0, 1.0], "pressure": [1.0, np.nan], "traction": [0.0, 0.0], "position": [1.0, 1.0]}
    errors = {"film": [0.2, 0.01], "pressure": [0.0101, 1.0], "traction": [0.1, 0.0], "position": [0.003, 0.0]}
    assert missed_accuracy(values, errors, 0.01, where=" on 9 nodes") == {
        0: "an accuracy of 0.01 is missed on 9 nodes; estimated relative errors: film 0.2, pressure 0.0101, "
        "traction unknown"
    }


def test_errors_are_relative_to_the_largest_value_or_to_the_floor():
    values = {"film": [2.0, 0.0], "profile": [[1.0, np.nan, -4.0], [0.0, 0.0, 0.0]], "share": [0.1, 5.0]}
    errors = {"film": [0.1, 0.0], "profile": [[0.2, 9.0, 0.4], [0.0, 0.1, 0.0]], "share": [0.1, 0.1]}
    found = missed_accuracy(values, errors, 0.019, {"share": 1.0})
    assert found[0].endswith("film 0.05, profile 0.1, share 0.1")
    assert found[1].endswith("profile unknown, share 0.02")
