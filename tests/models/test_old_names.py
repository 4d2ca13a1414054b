"""Names of version 0.1 are refused with a message that states the new name."""

from __future__ import annotations

import pytest

from mdr_dask import campaign, models
from mdr_dask.errors import CampaignError

PARAMETERS = {
    "sliding_friction": "profile",
    "velocity_jump": "profile",
    "fretting_wear": "angle curvature_radius load measured method modulus shape shear_modulus tolerance",
    "ehl_line": "neighbours",
    "mixed_lubrication": "measured poisson_ratio profile_1 profile_2 young_modulus",
}
OUTPUTS = {
    "sliding_friction": "discretisation_error",
    "velocity_jump": "discretisation_error",
    "fretting_wear": "block_normal_force discretisation_error",
    "ehl_line": "discretisation_error traction_error",
    "mixed_lubrication": "discretisation_error load_share",
}


@pytest.mark.parametrize("model", PARAMETERS)
def test_old_names_are_refused_with_what_to_write(model):
    parameters, outputs = PARAMETERS[model].split(), OUTPUTS[model].split()
    given = "".join(f"  {name}: 1\n" for name in parameters)
    text = f"name: old\nmodel: {model}\nparameters:\n{given}outputs: [{', '.join(outputs)}]\n"
    with pytest.raises(CampaignError) as refusal:
        campaign.loads(text, "old.yaml", ".")
    lines, renamed = str(refusal.value).splitlines(), models.load(model).parameters.renamed
    for name in [*parameters, *outputs]:
        assert any(name in line and renamed[name] in line for line in lines)
