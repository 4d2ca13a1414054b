"""The scripts in docs/examples draw their figures from small studies."""

import runpy
from pathlib import Path

import matplotlib as mpl
import pytest

from mdr_dask.cli import main

SCRIPTS = Path(__file__).parents[1] / "docs/examples"
SLIDING = """\
model: sliding_friction
seed: 1
realisations: 4
parameters:
  length: 20 mm
  points: 200
  rms_roughness: 0.5 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  hurst: [0.3, 0.7]
  normal_force: [2 mN, 5 mN, 10 mN, 30 mN]
  velocity: {geometric: [0.1 mm/s, 100 m/s, 13]}
outputs: [friction_coefficient, indentation_depth, rms_slope]
"""
FILM = """\
model: ehl_line
parameters:
  load_parameter: 2e-5
  speed_parameter: [1e-11, 1e-10]
  material_parameter: 5000
outputs: [minimum_film]
"""
WEAR = """\
model: fretting_wear
parameters:
  indenter: {shape: parabola}
  stick_radius: [0.3, 0.6]
  cycles: [0.5, 1, 4]
  points: 101
series:
  exact: {wear_rule: exact}
  fast: {wear_rule: fast, xi: [0.8, 0.9]}
outputs: [worn_profile]
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "campaign"),
    [
        ("contact.py", SLIDING),
        ("constants.py", SLIDING),
        ("collapse.py", SLIDING),
        ("film_regimes.py", FILM),
        ("fast_rule.py", WEAR),
    ],
)
def test_an_example_script_draws_its_figure(script, campaign, tmp_path, monkeypatch):
    mpl.use("Agg")
    monkeypatch.chdir(tmp_path)
    Path("study.yaml").write_text(f"name: study\n{campaign}")
    assert main(["run", "study.yaml", "--quiet"]) == 0
    monkeypatch.setattr("sys.argv", [script, "results/study.zarr", "figure.png"])
    runpy.run_path(str(SCRIPTS / script), run_name="__main__")
    assert Path("figure.png").stat().st_size > 10_000


def test_every_script_is_tested():
    assert {path.name for path in SCRIPTS.glob("*.py")} == {
        *("contact.py", "constants.py", "collapse.py", "film_regimes.py", "fast_rule.py")
    }
