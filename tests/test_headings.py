"""Headings of tables in German mean what they say."""

import pytest

from mdr_dask.headings import meanings

GERMAN = {
    "friction coefficient": ("Reibwert", "Reibungskoeffizient", "Reibungszahl", "Reibbeiwert"),
    "velocity": ("Geschwindigkeit", "Gleitgeschwindigkeit"),
    "rotation speed": ("Drehzahl",),
    "normal force": ("Kraft", "Normalkraft", "Last"),
    "line load": ("Linienlast",),
    "time": ("Zeit",),
    "path": ("Weg",),
    "position": ("Weg",),
    "height": ("Höhe", "Hoehe"),
    "wavenumber": ("Wellenzahl",),
    "wavelength": ("Wellenlänge",),
    "viscosity": ("Viskosität",),
    "kinematic viscosity": ("kinematische Viskosität",),
    "dynamic viscosity": ("Dynamische_Viskosität",),
    "cycles": ("Zyklen", "Lastwechsel"),
    "wear volume": ("Verschleißvolumen", "Verschleissvolumen"),
    "error": ("Fehler", "Messunsicherheit"),
    "standard deviation": ("Standardabweichung",),
    "frequency": ("Frequenz",),
    "storage modulus": ("Speichermodul",),
    "loss modulus": ("Verlustmodul",),
    "loss factor": ("Verlustfaktor",),
    "shift factor": ("Verschiebungsfaktor",),
    "temperature": ("Temperatur",),
    "angular frequency": ("Kreisfrequenz",),
}


@pytest.mark.parametrize(("meaning", "german"), [(key, word) for key, words in GERMAN.items() for word in words])
def test_german_headings_have_a_meaning(meaning, german):
    assert meaning in meanings(german)
