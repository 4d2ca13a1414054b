"""Reading of tables: equivalent layouts, and one message for each mistake."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mdr_dask.errors import DataError, MdrDaskError
from mdr_dask.headings import Column
from mdr_dask.tables import read_table

COLUMNS = (
    Column("frequency", "rad/s", ("f", "omega"), above=0),
    Column("storage modulus", "Pa", ("E'", "G'"), above=0),
    Column("tan delta", "1", needed=False, least=0),
    Column("temperature", "K", ("T",), needed=False, above=0),
)
DIALECTS = {
    "plain": "frequency [rad/s],storage modulus [Pa],temperature [K]\n10,1.1e6,293.15\n20,2.2e6,303.15\n",
    "other units": "frequency [rad/s],storage modulus [MPa],temperature [degC]\n10,1.1,20\n20,2.2,30\n",
    "other order": "temperature [C],frequency [rad/s],storage modulus [MPa]\n20,10,1.1\n30,20,2.2\n",
    "semicolons": "frequency [rad/s];storage modulus [MPa];temperature [°C]\n10;1.1;20\n20;2.2;30\n",
    "decimal comma": "frequency [rad/s];storage modulus [MPa];temperature [°C]\n10,0;1,1;20,0\n20,0;2,2;30,0\n",
    "decimal comma and blanks": "omega E' T\nrad/s kPa C\n10,0 1100 20\n20,0 2200 30,0\n",
    "tabs": "omega\tE'\tT\n[rad/s]\t[MPa]\t[K]\n10\t1.1\t293.15\n20\t2.2\t303.15\n",
    "a row of units": "Frequency,Storage_Modulus,Temperature\nrad/s,MPa,C\n10,1.1,20\n20,2.2,30\n",
    "byte-order mark": "\ufefffrequency [rad/s],storage modulus [MPa],T [K]\n10,1.1,293.15\n20,2.2,303.15\n",
    "comments": "# made by hand\n\nfrequency (rad/s), E’ (MPa), T (C)\n% two rows\n10, 1.1, 20\n20, 2.2, 30\n",
    "windows": 'frequency [rad/s],"storage modulus [bar]",T [K]\r\n10,11,293.15\r\n20,22,303.15\r\n',
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_dialects_of_one_table_are_the_same_numbers_to_the_bit(dialect):
    reference = read_table(DIALECTS["plain"], "a.csv", COLUMNS)
    read = read_table(DIALECTS[dialect], "a.csv", COLUMNS)
    assert {name: values.tobytes() for name, values in read.items()} == {
        name: values.tobytes() for name, values in reference.items()
    }


@pytest.mark.parametrize("one", ["1", "-", "[1]"])
def test_a_row_of_units_has_a_sign_for_what_has_none(one):
    """A tan delta of 1 in the first line of numbers is not a unit."""
    read = read_table(f"f,E',tan delta\nrad/s,MPa,{one}\n1,2,0.3\n4,5,1\n", "a.csv", COLUMNS)
    assert read["storage modulus"].tolist() == [2e6, 5e6]
    assert read["tan delta"].tolist() == [0.3, 1.0]


@pytest.mark.parametrize(
    ("heading", "value", "expected"),
    [
        ("Hz", "1", 2 * np.pi),
        ("kHz", "0.001", 2 * np.pi),
        ("1/s", "3", 3.0),
        ("rpm", "60", 2 * np.pi),
        ("rad/s", "5", 5.0),
    ],
)
def test_frequencies_are_angular_ones(heading, value, expected):
    read = read_table(f"f [{heading}],E' [mPa]\n{value},7\n", "a.csv", COLUMNS)
    assert read["frequency"] == pytest.approx(expected, rel=1e-15)
    assert read["storage modulus"] == 0.007


#: `$` is replaced by ``column storage modulus: ``
WRONG = {
    "nothing": ("", "1: expected a line of names and at least one line of values"),
    "comments only": ("# f\n", "1: expected a line of names and at least one line of values"),
    "names only": ("f [Hz],E' [Pa]\n", "1: expected a line of names and at least one line of values"),
    "no unit": ("f [Hz],E'\n1,2\n", "1: $expected its unit, such as 'storage modulus [MPa]' in the first line"),
    "capitals of a unit": ("f [Hz],E' [mpa]\n1,2\n", "1: $unknown unit 'mpa' (did you mean 'MPa'?)"),
    "unit of another kind": ("f [Hz],E' [mm]\n1,2\n", "1: $expected a pressure (such as '10 MPa')"),
    "dimension on a number": (
        "f [Hz],E' [Pa],tan delta [MPa]\n1,2,3\n",
        "1: column tan delta: expected a pure number",
    ),
    "unknown column": (
        "f [Hz],E' [Pa],tan delda\n1,2,3\n",
        "1: unknown column 'tan delda' (did you mean 'tan delta'?)",
    ),
    "missing column": ("f [Hz],torque [N]\n1,5\n", "1: expected a column 'storage modulus', got torque"),
    "twice": (
        "f [Hz],omega [Hz],E' [Pa]\n1,2,3\n",
        "1: column 'frequency' is given twice: 'f' and 'omega' disagree: delete one of the two",
    ),
    "ragged": ("f [Hz],E' [Pa]\n1,2\n3\n", "3: expected 2 values as in line 1, got 1"),
    "word": ("f [Hz],E' [Pa]\n1,2\n3,high\n", "3: $expected a number, got 'high'"),
    "empty": ("f [Hz],E' [Pa]\n1,2\n3,\n", "3: $expected a number, got ''"),
    "nan": ("f [Hz],E' [Pa]\n1,nan\n3,4\n", "2: $expected a number, got 'nan'"),
    "negative": ("f [Hz],E' [MPa]\n1,2\n3,-4\n", "3: $expected a value above 0, got '-4 MPa'"),
    "below absolute zero": (
        "f [Hz],E' [Pa],T [C]\n1,2,-300\n",
        "2: column temperature: expected a value above -273.15 degC, got '-300 degC'",
    ),
    "overflow": ("f [Hz],E' [MPa]\n1,1e305\n", "2: $expected a finite number"),
    "decimal comma in commas": (
        "f [Hz],E' [Pa]\n1,5,2\n",
        "2: expected 2 values as in line 1, got 3 (put semicolons between the values if they have decimal commas)",
    ),
    "missing number of two words": (
        "a b c\n1 0 3\n1 0 No Data\n",
        "3: expected 3 values as in line 1, got 4 (write a mis",
    ),
    "no names": ("1,2,3,4,5\n1,2,3,4,5\n", "1: expected the names of the 5 columns in the first line"),
    "long cell": ("f [Hz],E' [Pa]\n1," + "9" * 200_000 + "\n", "2: $expected a number"),
}


@pytest.mark.parametrize("kind", WRONG)
def test_what_is_wrong_is_one_sentence_with_its_place(kind):
    text, sentence = WRONG[kind]
    with pytest.raises(DataError) as caught:
        read_table(text, "a.csv", COLUMNS)
    expected = "a.csv:" + sentence.replace("$", "column storage modulus: ")
    assert str(caught.value).splitlines()[0].startswith(expected)


def test_each_column_has_one_message():
    with pytest.raises(DataError) as caught:
        read_table("f [Hz],E' [Pa]\n" + "-1,x\n" * 20, "a.csv", COLUMNS)
    frequency, modulus = str(caught.value).splitlines()
    assert frequency.startswith("a.csv:2: column frequency: expected a value above 0, got '-1 Hz'")
    assert modulus.endswith("expected a number, got 'x' (and in 19 more lines)")


def test_columns_that_resemble_nothing_are_not_used():
    optional = [Column("velocity", "m/s"), Column("mean_velocity", "m/s", needed=False)]
    optional.append(Column("oil_density", "kg/m^3", needed=False))
    read = read_table("velocity [m/s];Torque;oil temp [degC]\n1;2;3\n", "a.csv", optional)
    assert read.remark == "not used: Torque, oil temp"


def test_empty_entries_may_be_allowed():
    read = read_table("f [Hz],E' [Pa]\n1,\n2,3\n", "a.csv", COLUMNS, allow_missing=True)
    assert np.isnan(read["storage modulus"][0])


def test_a_given_unit_serves_a_table_without_one():
    column = Column("x", "m", given_unit="mm")
    assert read_table("x\n5\n", "a.csv", [column])["x"] == 0.005
    assert read_table("5\n6\n", "a.csv", [column])["x"][1] == 0.006
    assert read_table("x [mm]\n5\n", "a.csv", [column])["x"] == 0.005
    with pytest.raises(DataError, match="the file states 'um', got the unit 'mm'"):
        read_table("x [um]\n5\n", "a.csv", [column])


@given(st.text(max_size=200))
def test_any_text_is_a_table_or_an_error(text):
    try:
        read = read_table(text, "a.csv", COLUMNS)
    except MdrDaskError:
        return
    assert all(np.all(np.isfinite(values)) for values in read.values())
