"""Stores for tests of report pages: a small study of friction, and one whose names and messages contain markup."""

from dataclasses import replace

import toy as toy_model

from mdr_dask import execute
from mdr_dask.campaign import loads
from mdr_dask.models.base import Output

FRICTION = """\
# rubber & glass: <b>bold</b>
name: small
model: sliding_friction
seed: 7
realisations: 4
parameters:
  length: 20 mm
  points: 100
  hurst: 0.7
  rms_roughness: 0.5 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  normal_force: [0.1 N, 1 N, 10 N]
  velocity: {geometric: [1 mm/s, 10 m/s, 5]}
outputs: [friction_coefficient, contact_fraction, rms_slope]
"""
#: Text that would run a script if it were inserted as markup.
HOSTILE = "</script><script>window.ran = 1</script><img src=x onerror='window.ran = 2'><b>$x_1$"


def friction(url):
    execute.run(loads(FRICTION, "small.yaml", "."), url, execute.Resources(threads=2), lambda _: None)


def hostile(url, monkeypatch):
    """Run a study whose names, descriptions and messages contain markup; half of its cases fail."""

    def compute(block):
        result = toy_model.compute(block)
        return replace(result, messages=dict.fromkeys(result.messages, HOSTILE))

    output = Output("height", "m", f"height {HOSTILE}")
    model = replace(toy_model.MODEL, outputs=(output,), compute=compute, summary=HOSTILE)
    monkeypatch.setattr(toy_model, "MODEL", model)
    toy_model.register(monkeypatch)
    axes = (toy_model.axis("position", [1.0, 2.0, 3.0, 4.0]), toy_model.axis("slope", [1.0, 2.0]))
    made = toy_model.campaign(*axes, fail_above=2.5)
    execute.run(replace(made, name=HOSTILE, text=f"# {HOSTILE}"), url, execute.Resources(threads=1), lambda _: None)
