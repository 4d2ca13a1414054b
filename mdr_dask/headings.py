"""How columns of tables are called: what does not matter in a name, and German names."""

from __future__ import annotations

import re

_ALIKE = str.maketrans({"’": "'", "′": "'", "″": "''", '"': "''", "ä": "ae", "ö": "oe", "ü": "ue"})
#: German headings, and what each may stand for.
GERMAN = {
    "temperatur": ("temperature",),
    "frequenz": ("frequency",),
    "kreisfrequenz": ("angular frequency",),
    "speichermodul": ("storage modulus",),
    "verlustmodul": ("loss modulus",),
    "verlustfaktor": ("loss factor",),
    "verschiebungsfaktor": ("shift factor",),
    **dict.fromkeys(("reibwert", "reibungskoeffizient", "reibungszahl", "reibbeiwert"), ("friction coefficient",)),
    **dict.fromkeys(("geschwindigkeit", "gleitgeschwindigkeit"), ("velocity",)),
    "drehzahl": ("rotation speed",),
    **dict.fromkeys(("kraft", "normalkraft", "last"), ("normal force",)),
    "linienlast": ("line load",),
    "zeit": ("time",),
    "weg": ("path", "position"),
    "hoehe": ("height",),
    "wellenzahl": ("wavenumber",),
    "wellenlaenge": ("wavelength",),
    "viskositaet": ("viscosity",),
    "kinematische viskositaet": ("kinematic viscosity",),
    "dynamische viskositaet": ("dynamic viscosity",),
    **dict.fromkeys(("zyklen", "lastwechsel"), ("cycles",)),
    "verschleissvolumen": ("wear volume",),
    **dict.fromkeys(("fehler", "messunsicherheit"), ("error",)),
    "standardabweichung": ("standard deviation",),
}


def meanings(heading: str) -> set[str]:
    """Return a heading without what does not matter, and what it means if it is German."""
    said = folded(heading)
    return {said, *GERMAN.get(said, ())}


def folded(name: str) -> str:
    """Return a name without what does not matter: blanks, underscores, hyphens, dots, capitals, kinds of primes."""
    return re.sub(r"[\s_.-]+", " ", name.strip().casefold()).translate(_ALIKE)
