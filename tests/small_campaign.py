"""A small campaign of sliding friction, for tests of the command line."""

CAMPAIGN = """\
name: small
model: sliding_friction
seed: 7
realisations: 8
parameters:
  length: 20 mm
  points: 500
  hurst: 0.7
  rms_roughness: 0.5 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  normal_force: [0.1 N, 10 N]
  velocity: {geometric: [1 mm/s, 1 m/s, 4]}
"""
