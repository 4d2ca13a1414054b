"""Printed tables fit the terminal and omit columns that are the same in every row."""

import math

import pytest

from mdr_dask.cli.printing import print_aligned, print_rows, with_error, with_interval

NAMES = [
    "normal_force [N]",
    "breakthrough_probability",
    "wear_volume_of_the_first_body [m^3]",
    "realisations",
    "status",
]


@pytest.fixture
def printed(capsys, monkeypatch):
    def call(*arguments, columns=80, **options):
        monkeypatch.setenv("COLUMNS", str(columns))
        print_aligned(*arguments, **options)
        return capsys.readouterr().out.splitlines()

    return call


@pytest.mark.parametrize("columns", [60, 80, 120])
@pytest.mark.parametrize("rows", [1, 2, 30])
def test_no_line_is_wider_than_the_terminal(printed, columns, rows):
    names = [f"{name}_{k}" for k in range(4) for name in ("a_very_long_name_of_an_output", "short")]
    cells = [[f"{row + k}.123 +- 0.001 +- 0.002" for row in range(rows)] for k in range(8)]
    lines = printed(names, cells, columns=columns)
    assert max(map(len, lines)) <= columns
    text = " ".join("".join(lines).split())
    assert all(cell in text for column in cells for cell in column)


def test_constant_columns_are_printed_above_the_table(printed):
    columns = [[1.0, 2.0], ["0.1 +- 0.01", "0.2 +- 0.01"], [float("nan")] * 2, [20, 20], ["done", "done"]]
    note, missing, *_, last = printed(NAMES, columns)
    assert note == "in these rows: realisations = 20, status = done; not known:"
    assert missing.strip() == "wear_volume_of_the_first_body"
    assert last.split() == ["2", "0.2", "+-", "0.01"]
    assert not any("nan" in line for line in printed(NAMES, columns))


def test_every_part_of_a_wide_table_begins_with_its_keys(printed):
    lines = printed(
        ["force", "speed", "a", "b"], [[1, 2], [3, 4], ["x" * 30, "y" * 30], ["u" * 30, "v" * 30]], keys=2, columns=50
    )
    assert [line.split()[:2] for line in lines if line.strip()[:1].isdigit()] == [["1", "3"], ["2", "4"]] * 2


def test_a_single_row_that_is_too_wide_is_a_list(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    verdict = "no: the law misses the points by 12 % where 3 % would be within their errors"
    print_rows([{"alpha": 0.71, "chi_squared": float("nan"), "law_holds": verdict}], {"alpha": "1"}, "table")
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[:3]] == ["alpha", "chi_squared", "law_holds"]
    assert max(map(len, lines)) <= 40


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (with_error(17670.0, 50.0), "17670 +- 50"),
        (with_error(1.2341e-9, 2e-12), "1.234e-09 +- 2e-12"),
        (with_error(0.1642, None, 2e-4), "0.1642 +- ? +- 0.0002"),
        (with_error(float("nan"), 0.1), "-"),
        (with_interval(0.5, 0.4, 0.6), "0.5 (0.4, 0.6)"),
        (with_interval(0.5), "0.5"),
        (with_interval(math.nan), "not determined"),
    ],
)
def test_numbers_with_errors(text, expected):
    assert text == expected
