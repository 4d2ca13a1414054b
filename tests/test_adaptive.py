"""Adaptive axes: the interpolation meets its tolerance with few values, and does not depend on interruptions."""

import json
import re

import curves
import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from test_execute import digests, run

from mdr_dask import execute, store
from mdr_dask.campaign import loads
from mdr_dask.cli import main
from mdr_dask.errors import CampaignError
from mdr_dask.execute import Part, Resources
from mdr_dask.fits.interpolant import law
from mdr_dask.models.base import Status
from mdr_dask.questions.table import Question, table

AXIS = "{adaptive: [1 mm, 1 km], until: 1 %, at_most: 60}"


@pytest.fixture
def study(monkeypatch):
    """Return a campaign of curves from its parameters, and perhaps more keys."""
    curves.register(monkeypatch)

    def campaign(parameters: str, x: str = AXIS, more: str = ""):
        text = f"name: c\nmodel: curves\nparameters: {{x: {x}, {parameters}}}\n{more}"
        return loads(text, "c.yaml", ".")

    return campaign


def means(url):
    """Return the abscissae, and the mean of every curve over them; NaN where none was needed."""
    found = store.datasets(url)[""].y.mean("realisation").transpose(..., "x")
    return found.x.to_numpy(), found.to_numpy().reshape(-1, found.sizes["x"])


def test_each_curve_has_what_its_interpolation_needs_and_the_rest_is_not_needed(study, url):
    shifts = [-1.5, 0.3, 1.7]
    progress = run(study(f"shift: {shifts}"), url)
    x, y = means(url)
    dense = np.geomspace(1e-3, 1e3, 500)
    for shift, curve in zip(shifts, y, strict=True):
        known = np.isfinite(curve)
        found = PchipInterpolator(np.log(x[known]), curve[known])(np.log(dense))
        assert np.max(np.abs(found - curves.FUNCTIONS["smooth"](dense, shift))) < 0.012
        assert known.sum() <= 25
    status = store.datasets(url)[""].status.to_numpy()
    assert progress.done == (status == Status.DONE).sum() < status.size
    assert set(status.ravel()) == {Status.DONE, Status.NOT_NEEDED}
    assert progress.total == status.size
    assert not store.verify(url).findings


@pytest.mark.parametrize(("shape", "most"), [("kink", 25), ("jump", 45), ("gap", 40), ("flat", 9)])
def test_discontinuous_curves_end_and_leave_other_curves_resolved(study, url, shape, most):
    events = []
    run(study(f"shape: [{shape}, smooth], shift: [-0.7, 0.9]", AXIS.replace("60", "45")), url, tell=events.append)
    data = store.datasets(url)[""].y.mean("realisation")
    assert (data.sel(shape=shape).notnull().sum("x") <= most).all()
    for shift in (-0.7, 0.9):
        smooth = data.sel(shape="smooth", shift=shift).dropna("x")
        dense = np.geomspace(1e-3, 1e3, 200)
        found = PchipInterpolator(np.log(smooth.x), smooth)(np.log(dense))
        assert np.max(np.abs(found - curves.FUNCTIONS["smooth"](dense, shift))) < 0.012
    last = [event for event in events if event.name == "refined"][-1]
    assert ("misses its tolerance" in last.sentence) == (shape == "jump")


def test_a_smooth_knee_anywhere_is_interpolated_within_the_tolerance(study, url):
    shifts = np.linspace(-2.9, 2.9, 30).round(2).tolist()
    run(study(f"shape: knee, shift: {shifts}", AXIS.replace("60", "400")), url)
    x, y = means(url)
    dense = np.geomspace(1e-3, 1e3, 500)
    ratios = []
    for shift, curve in zip(shifts, y, strict=True):
        known = np.isfinite(curve)
        truth = curves.FUNCTIONS["knee"](dense, shift)
        away = np.abs(PchipInterpolator(np.log(x[known]), curve[known])(np.log(dense)) - truth).max()
        ratios.append(away / truth.max() / 0.01)
    assert np.mean(np.array(ratios) <= 1) >= 0.9
    assert max(ratios) <= 2


def test_the_most_values_are_those_of_each_curve(study, url):
    """Knees at different places need different values: together more than a single curve may have."""
    shifts = np.linspace(-2, 2, 9).round(2).tolist()
    sentences = []
    enough, few = (study(f"shape: knee, shift: {shifts}", AXIS.replace("60", most)) for most in ("32", "10"))
    run(enough, url, tell=lambda event: sentences.append(event.sentence))
    values = store.datasets(url)[""].y.notnull().all("realisation")
    assert values.sizes["x"] > 32
    assert int(values.sum("x").max()) <= 32
    assert not any("misses its tolerance" in sentence for sentence in sentences)
    run(few, url + "2", tell=lambda event: sentences.append(event.sentence))
    assert int(store.datasets(url + "2")[""].y.notnull().all("realisation").sum("x").max()) == 10
    assert re.search("along x misses its tolerance in . of 9 cases: at_most is 10 values", " ".join(sentences))


def test_scatter_is_not_refined(study, url):
    run(study("shape: flat, noise: 0.05", more="realisations: 10"), url)
    assert means(url)[0].size <= 14
    run(study("shape: flat, noise: 1e-4", more="realisations: 10"), url + "2")
    assert means(url + "2")[0].size == 9


KILLED = "noise: 0.02, shift: [-1, 0.5], shape: [smooth, jump]"
MORE = "realisations: {at_least: 4, at_most: 12, until: {y: 1 %}}\nstore: {blocks: {x: 2, shift: 1, realisation: 2}}"


@pytest.mark.slow
def test_interrupted_runs_and_parts_end_with_the_same_bytes(study, tmp_path):
    campaign = study(KILLED, AXIS.replace("60", "14"), MORE)
    whole, stopped, parts = (str(tmp_path / name) for name in ("whole.zarr", "stopped.zarr", "parts.zarr"))
    expected = run(campaign, whole)

    def stop_after(blocks):
        def report(progress):
            if progress.blocks >= blocks:
                raise KeyboardInterrupt

        return report

    stops = 0
    for blocks in (1, 9, 20, 40):
        try:
            execute.run(campaign, stopped, Resources(threads=1), stop_after(blocks))
        except KeyboardInterrupt:
            stops += 1
    assert stops == 4
    run(campaign, stopped)
    assert digests(stopped) == digests(whole)
    again = run(campaign, stopped)
    assert (again.done, again.failed, again.not_needed) == (0, 0, 0)
    assert again.kept >= expected.done
    done = {1: 0, 2: 0}
    for _ in range(12):
        for number in done:
            done[number] += run(campaign, parts, part=Part(number, 2)).done
    run(campaign, parts)
    assert min(done.values()) > 0
    assert digests(parts) == digests(whole)


def test_existing_values_are_used(study, url):
    dense = study("shift: [0.2, 0.6]", "{geometric: [1 mm, 1 km, 65]}")
    run(dense, url)
    before = digests(url)
    adaptive = study("shift: [0.2, 0.6]")
    assert execute.outlook(adaptive, url).to_do == 0
    assert run(adaptive, url).done == 0
    assert digests(url) == before
    wider = study("shift: [0.2, 0.6, 1.1]")
    needed = run(wider, url + "2")
    assert run(wider, url).done == needed.done - (store.datasets(url + "2")[""].y.notnull().sel(shift=[0.2, 0.6])).sum()


def test_two_axes_are_refined_together(study, url):
    run(study("shift: {adaptive: [-1, 1], until: {half: 1 %}, at_most: 20}", more="outputs: [y, half]"), url)
    data = store.datasets(url)[""].y.mean("realisation")
    assert data.notnull().all()
    assert 5 < data.sizes["shift"] <= 20
    dense = np.geomspace(1e-3, 1e3, 100)
    along_x = PchipInterpolator(np.log(data.x), data.transpose("x", "shift"))(np.log(dense))
    found = PchipInterpolator(data["shift"], along_x, axis=1)(0.4321)
    assert np.max(np.abs(found - np.tanh(np.log10(dense) - 0.4321))) < 0.03


def test_check_and_dry_run_state_the_range_of_results(study, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = f"name: c\nmodel: curves\nparameters: {{x: {AXIS}, shift: [0.1, 0.2]}}\n"
    (tmp_path / "c.yaml").write_text(text)
    assert study  # registers the model
    assert main(["check", "c.yaml"]) == 0
    printed = capsys.readouterr().out
    assert "geometric, until y is interpolated with an error below 1 % of its largest value" in printed
    assert "10 to 120 cases x 1 realisation = 10 to 120 results" in printed
    assert main(["run", "c.yaml", "--dry-run", "--json"]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert (plan["counted"], plan["results"], plan["results_at_most"]) == ("values chosen so far", 10, 120)
    assert main(["run", "c.yaml", "--quiet"]) == 0
    capsys.readouterr()
    assert main(["run", "c.yaml", "--dry-run"]) == 0
    assert "results are there already; nothing to do" in capsys.readouterr().out
    assert main(["run", "c.yaml", "--dry-run", "--json"]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert (plan["counted"], plan["to_do"]) == ("all", 0)
    (tmp_path / "c.yaml").write_text(text.replace("0.2]", "0.2, 0.4]"))
    assert main(["run", "c.yaml", "--dry-run"]) == 0
    assert "results of the values chosen so far are in the store already" in capsys.readouterr().out


WRONG = {
    "three axes": ("shift: {adaptive: [0, 1], until: 1 %}, noise: {adaptive: [0, 1], until: 1 %}", AXIS, "", "most 2"),
    "zip": ("shift: 1", AXIS, "sampling: zip", "expected 'sampling: grid', because this axis is adaptive"),
    "no tolerance": ("shift: 1", "{adaptive: [1 m, 2 m]}", "", r"x\.until: .*missing|until"),
    "few": ("shift: 1", "{adaptive: [1 m, 2 m], until: 1 %, at_most: 4}", "", r"at_most: .* at least 5, got 4"),
    "same ends": ("shift: 1", "{adaptive: [1 m, 1 m], until: 1 %}", "", "expected two different ends"),
    "output": ("shift: 1", "{adaptive: [1 m, 2 m], until: {yy: 1 %}}", "", r"until\.yy: this is not an output"),
}


@pytest.mark.parametrize("case", WRONG)
def test_invalid_adaptive_axes_are_refused(study, case):
    parameters, x, more, sentence = WRONG[case]
    with pytest.raises(CampaignError, match=sentence):
        study(parameters, x, more)


def test_laws_and_tables_omit_values_that_were_not_needed(study, url):
    shifts = [-1.2, -0.4, 0.4, 1.2]
    run(study(f"shift: {shifts}"), url)
    data = store.datasets(url)[""]
    needed = int((data.status == Status.DONE).sum())
    assert len(table(data, Question(("y",))).frames.__next__()) == needed < data.status.size
    found = law(data, "y")
    for shift in shifts:
        truth = curves.FUNCTIONS["smooth"](found.x.to_numpy(), shift)
        away = np.abs(found.y.sel(shift=shift).to_numpy() - truth)
        assert away.max() < 0.015
        assert np.mean(away <= found.y_error.sel(shift=shift).to_numpy() + 1e-9) > 0.8


@pytest.mark.parametrize(
    ("until", "outputs"), [("{film: 1 %}", "film, minimum_film"), ("1 %", "film")], ids=["named", "all"]
)
def test_an_axis_is_refined_by_outputs_of_one_number(until, outputs):
    speeds = f"{{adaptive: [1e-12, 1e-10], until: {until}}}"
    parameters = f"load_parameter: 2e-5, material_parameter: 5000, speed_parameter: {speeds}"
    with pytest.raises(CampaignError, match=r"until.*: expected .*output with a single number for each case"):
        loads(f"name: c\nmodel: ehl_line\nparameters: {{{parameters}}}\noutputs: [{outputs}]\n", "c.yaml", ".")
