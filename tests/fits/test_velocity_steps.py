"""Rate-and-state constants of a measured velocity-step test: planted values are held, bad traces are named."""

import json

import numpy as np
import pytest

from mdr_dask.cli import main
from mdr_dask.errors import DataError
from mdr_dask.fits.velocity_steps import Trace, _fitted, of_table, rate_and_state

TRUE = {"direct_effect": 0.011, "evolution_effect": 0.016, "velocity_dependence": -0.005}
TIME = np.arange(150) * 0.5
VELOCITY = np.where((TIME > 20) & (TIME < 50), 1e-5, 1e-6)


def friction(length, scatter, rng):
    """The closed solution of the slip law behind each of the two steps, apart from the recursion of the fit."""
    slip, decade = np.concatenate([[0.0], np.cumsum(np.diff(TIME) * VELOCITY[1:])]), np.log(10)
    up, down = (np.flatnonzero(np.diff(VELOCITY))[k] for k in (0, 1))
    since = np.maximum(slip - slip[up], 0.0), np.maximum(slip - slip[down], 0.0)
    state = -decade * (1 - np.exp(-since[0] / length))
    last = -decade * (1 - np.exp(-(slip[down] - slip[up]) / length))
    state = np.where(slip > slip[down], last * np.exp(-since[1] / length), state)
    steady = 0.62 + TRUE["direct_effect"] * np.log(VELOCITY / VELOCITY[0]) + TRUE["evolution_effect"] * state
    return steady + scatter * rng.normal(size=TIME.size)


def test_planted_values_are_held_in_95_of_100():
    rng = np.random.default_rng(4)
    held = dict.fromkeys((*TRUE, "slip_length"), 0)
    for _ in range(60):
        length = 10 ** rng.uniform(-5.2, -4.3)
        found = rate_and_state(Trace(TIME, VELOCITY, friction(length, 3e-4, rng)))
        for name, true in (TRUE | {"slip_length": length}).items():
            held[name] += bool(found[f"{name}_low"] < true < found[f"{name}_high"])
        assert found["law_holds"].item().startswith("yes")
    for name, hits in held.items():
        assert hits / 60 > 0.95 - 3 * np.sqrt(0.95 * 0.05 / 60), name


def test_scatter_that_goes_along_widens_the_intervals():
    rng = np.random.default_rng(1)
    exact, white = friction(2e-5, 0.0, rng), rng.normal(size=TIME.size)
    along = np.convolve(white, np.ones(5) / np.sqrt(5), mode="same")
    ends = [rate_and_state(Trace(TIME, VELOCITY, exact + 3e-4 * noise)) for noise in (white, along)]
    widths = [float(one["evolution_effect_high"] - one["evolution_effect_low"]) for one in ends]
    assert widths[1] > 1.4 * widths[0]


def test_a_slip_length_below_the_rows_has_no_number():
    found = rate_and_state(Trace(TIME, VELOCITY, friction(1e-8, 3e-4, np.random.default_rng(2))))
    assert np.isnan(found["slip_length"])
    assert found["law_holds"].item().startswith("not tested: the slip length lies below")


def test_a_table_in_a_shell(tmp_path, capsys):
    rows = zip(TIME, VELOCITY * 1e6, friction(2e-5, 3e-4, np.random.default_rng(3)), strict=True)
    path = tmp_path / "steps.csv"
    path.write_text("time [s],velocity [um/s],mu\n" + "".join(f"{t},{v},{mu:.6f}\n" for t, v, mu in rows))
    assert main(["fit", str(path), "rate_and_state", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row["slip_length_low"] < 2e-5 < row["slip_length_high"]
    assert main(["fit", str(path), "zone_one"]) == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time [s],mu\n1,0.5\n", "expected a column velocity"),
        ("time [s],velocity [m/s],mu\n" + "1,1,1\n" * 3, "expected at least 8 rows, got 3"),
        ("time [s],velocity [m/s],mu\n" + "1,1,1\n" * 9, "expected a time that goes on, got 1 s behind 1 s"),
        ("time [s],velocity [m/s],mu\n" + "".join(f"{k},1,1\n" for k in range(9)), "got 1 m/s throughout"),
    ],
)
def test_bad_traces_are_named(text, message):
    with pytest.raises(DataError, match=message):
        of_table(text, "steps.csv")


def test_the_density_of_a_slip_length_is_that_of_all_constants_and_scatters():
    """Constants and scatter integrated out one by one, the scatter numerically over its logarithm."""
    state = friction(1e-5, 0.0, np.random.default_rng(0))[::15]
    trace = Trace(TIME[::15], VELOCITY[::15], state + 1e-3 * np.sin(7.0 * np.arange(state.size)))
    linear = _fitted(trace, np.array([3e-6, 1e-5, 3e-5, 1e-4]))
    rows = trace.friction.size
    whole = []
    for spread, squares in zip(linear.spreads, linear.squares, strict=True):
        scatter = np.sqrt(squares) * np.geomspace(1e-2, 1e3, 20001)
        density = scatter ** (3 - rows) * np.exp(-squares / (2 * scatter**2))
        whole.append(np.log(np.sqrt(np.linalg.det(spread)) * np.trapezoid(density, np.log(scatter))))
    np.testing.assert_allclose(linear.density(rows), np.array(whole) - max(whole), atol=1e-6)


def test_the_state_follows_a_step_from_its_first_row_on():
    """dx/ds = -(x + ln(v / v_1)) / D_c: at a constant velocity x goes to -ln(v / v_1) within D_c."""
    time, velocity = np.array([0.0, 1.0, 2.0, 5.0]), np.array([1e-6, 1e-5, 1e-5, 1e-6])
    states = Trace(time, velocity, np.full(4, 0.6)).state(np.array([5e-6, 2e-5]))
    for length, state in zip((5e-6, 2e-5), states, strict=True):
        step, back = -np.log(10), np.exp(-3e-6 / length)
        gone = [0.0, *(step * (1 - np.exp(-slip / length)) for slip in (1e-5, 2e-5))]
        np.testing.assert_allclose(state, [*gone, gone[-1] * back], rtol=1e-12)
