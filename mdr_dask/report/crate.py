"""What a published study says of itself to machines: RO-Crate 1.1 (https://w3id.org/ro/crate/1.1)."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from mdr_dask.report.study import Study
from mdr_dask.store import CRATE, PUBLISHED
from mdr_dask.version import __version__

CONTEXT = "https://w3id.org/ro/crate/1.1/context"
PROFILE = "https://w3id.org/ro/crate/1.1"
#: Formats by the ends of names.
FORMATS = {
    "html": "text/html",
    "json": "application/json",
    "yaml": "application/yaml",
    "csv": "text/csv",
    "txt": "text/plain",
}
MEANINGS = {
    "report.html": "page with figures, laws, errors, method and limits; opens in any browser",
    "environment.txt": "packages installed when the study was published",
}


def metadata(study: Study, digests: Mapping[str, str], sizes: Mapping[str, int], licence: str) -> dict[str, Any]:
    """Return the metadata of a crate that holds a study.

    Parameters
    ----------
    study : Study
        What is packed.
    digests, sizes : mapping of str
        Of every file, by its name in the crate.
    licence : str
        Address, or name in the list of SPDX; without one the crate says that none was stated.
    """
    beside = [name for name in digests if name.startswith(PUBLISHED)]
    arrays = sorted({name.split("/c/")[0] for name in digests if "/c/" in name})
    named = [_file(name, digests, sizes, study) for name in ("zarr.json", *beside)]
    folders = [_array(name) for name in arrays]
    parts = [{"@id": each["@id"]} for each in (*named, *folders)]
    terms = _licence(licence)
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": f"{study.title}: a parameter study with {study.model}",
        "description": f"{study.summary}; results: {study.facts['results']}; a Zarr store, format 3",
        "datePublished": datetime.now(UTC).date().isoformat(),
        "license": {"@id": terms["@id"]},
        "hasPart": parts,
        "mentions": {"@id": "#run"},
    }
    written = {"@id": CRATE, "@type": "CreativeWork", "conformsTo": {"@id": PROFILE}, "about": {"@id": "./"}}
    graph = [written, root, *named, *folders, terms, _program(study), _run(study, beside, arrays)]
    return {"@context": CONTEXT, "@graph": graph}


def _file(name: str, digests: Mapping[str, str], sizes: Mapping[str, int], study: Study) -> dict[str, Any]:
    short = name.removeprefix(PUBLISHED)
    meaning = MEANINGS.get(
        short, "metadata of the Zarr store" if name == "zarr.json" else "a file that the campaign names"
    )
    return {
        "@id": name,
        "@type": "File",
        "name": short,
        "description": "the campaign as written" if short == study.source else meaning,
        "encodingFormat": FORMATS.get(name.rpartition(".")[2], "application/octet-stream"),
        "contentSize": str(sizes[name]),
        "sha256": digests[name],
    }


def _array(name: str) -> dict[str, Any]:
    return {"@id": f"{name}/", "@type": "Dataset", "name": name, "description": f"array {name} of the Zarr store"}


def _licence(licence: str) -> dict[str, Any]:
    if not licence:
        told = "Whoever published this study stated no licence; ask before you use it."
        return {"@id": "#licence", "@type": "CreativeWork", "name": "no licence stated", "description": told}
    address = licence if "://" in licence else f"https://spdx.org/licenses/{licence}"
    return {"@id": address, "@type": "CreativeWork", "name": licence, "description": f"licence {licence}"}


def _program(study: Study) -> dict[str, Any]:
    return {
        "@id": "#mdr_dask",
        "@type": "SoftwareApplication",
        "name": "mdr_dask",
        "version": __version__,
        "description": f"computed by {study.facts['computed by']}. {study.subject.method if study.subject else ''}",
    }


def _run(study: Study, beside: list[str], arrays: list[str]) -> dict[str, Any]:
    given = [{"@id": name} for name in beside if name.removeprefix(PUBLISHED) not in MEANINGS]
    found: dict[str, Any] = {
        "@id": "#run",
        "@type": "CreateAction",
        "name": f"run of the campaign {study.title}",
        "instrument": {"@id": "#mdr_dask"},
        "object": given if len(given) > 1 else given[0],
        "result": [{"@id": "zarr.json"}, *({"@id": f"{name}/"} for name in arrays)],
        "startTime": study.facts["laid out"],
    }
    return {**found, "endTime": study.facts["last block"]} if "last block" in study.facts else found
