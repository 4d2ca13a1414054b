"""The first campaign of every model passes every check, as written and with each of its choices taken."""

import re

import pytest
from test_own_model import MODULE

from mdr_dask import models
from mdr_dask.campaign import loads
from mdr_dask.campaign.draft import draft
from mdr_dask.cli import main
from mdr_dask.models.base import describe

NAMES = ("sliding_friction", "velocity_jump", "fretting_wear", "ehl_line", "mixed_lubrication")
#: Optional entries that need more than themselves.
NEED_MORE = {
    "path": "in place of cycles and amplitude",
    "temperature": "needs a law",
    "protocol": "names a file, or several entries",
    "film_thickness": "in place of a formula",
}


@pytest.fixture(autouse=True)
def real_models(monkeypatch):
    monkeypatch.undo()


@pytest.mark.parametrize("name", NAMES)
def test_the_draft_passes_as_written(name):
    text = draft(name, models.load(name), "first.yaml")
    campaign = loads(text, "first.yaml", ".")
    assert campaign.remarks == ()
    assert campaign.outputs == models.load(name).with_companions(
        [output.name for output in models.load(name).outputs if output.default]
    )
    missing = [field for field in models.load(name).parameters.model_fields if f" {field}: " not in text]
    assert missing == []


@pytest.mark.parametrize("name", NAMES)
def test_every_optional_entry_passes_when_its_mark_is_taken_off(name, tmp_path):
    (tmp_path / "table.csv").write_text("T [degC],nu [cSt]\n40,320\n100,38\n")
    model = models.load(name)
    text = draft(name, model, "first.yaml")
    beside = {each.partition(".")[0] for ways in model.parameters.alternatives for way in ways for each in way}
    entries = re.findall(r"^  # (?:or )?((\w+): .*)$", text, flags=re.M)
    tried = [entry for entry, field in entries if field not in beside | set(NEED_MORE) and "[...]" not in entry]
    assert len(tried) > 5
    for entry in tried:
        assert loads(text.replace("\n\noutputs", f"\n  {entry}\n\noutputs"), entry, str(tmp_path)).series


@pytest.mark.parametrize("name", NAMES)
def test_every_way_to_give_a_thing_passes(name, tmp_path):
    line = "x [m],z [m]\n" + "\n".join(f"{k * 0.1},{7 * k % 100 * 1e-8}" for k in range(100))
    spectrum = "q [1/mm],C2D [m^4]\n1,1e-18\n100,1e-24\n"
    model = models.load(name)
    text = draft(name, model, "first.yaml")
    for ways in model.parameters.alternatives:
        fields = {each.partition(".")[0] for way in ways for each in way}
        others = {each for more in model.parameters.alternatives if more is not ways for each in more[0]}
        for way in ways:
            kept = {each.partition(".")[0] for each in way} | others
            changed = text
            for field in fields:
                mark = "" if field in kept else "# "
                changed = re.sub(rf"^  (?:# )?{field}: ", f"  {mark}{field}: ", changed, count=1, flags=re.M)
            alone = way == ("surface",)  # a line as it is brings its length with it
            (tmp_path / "table.csv").write_text(line if alone else spectrum)
            kind = "{profile: {file: table.csv}}" if alone else "{spectrum: {files: [table.csv]}}"
            changed = changed.replace("{spectrum: {files: [table.csv]}}", kind)
            assert loads(changed, describe((way,)), str(tmp_path)).series


def test_a_model_of_ones_own_has_a_draft_too(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    hardness = '    hardness: float = quantity("Pa", "hardness of the softer body", gt=0)\n'
    more = {"passes: int": ("1", ", ge=2"), "shift: float": ("K", ""), "angle: float": ("rad", ", ge=10, le=20")}
    bounds = "".join(f'    {field} = quantity({unit!r}, "more"{ends})\n' for field, (unit, ends) in more.items())
    assert hardness in MODULE
    (tmp_path / "drafted.py").write_text(MODULE.replace(hardness, hardness + bounds))
    assert main(["init", "drafted:MODEL", "-o", "pin.yaml"]) == 0
    assert main(["check", "pin.yaml"]) == 0
    assert "\nname: wear_rate\n" in (tmp_path / "pin.yaml").read_text()
    assert "hardness: 1 Pa" in (tmp_path / "pin.yaml").read_text()
    assert "passes: 3 " in (tmp_path / "pin.yaml").read_text()  # above a bound without an upper one
    assert "angle: 15 rad " in (tmp_path / "pin.yaml").read_text()  # between two bounds
    assert "shift: 1 K " in (tmp_path / "pin.yaml").read_text()  # without any bound
    capsys.readouterr()
    assert main(["init", "drafted:MODEL", "-o", "pin.yaml"]) == 2
    assert "pin.yaml: this file exists already" in capsys.readouterr().err
    assert main(["init", "sliding_frition"]) == 2
    assert "(did you mean 'sliding_friction'?)" in capsys.readouterr().err
