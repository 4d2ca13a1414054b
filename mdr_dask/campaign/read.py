"""Read the text of a campaign file into a checked `Campaign`."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Any

from pydantic import ValidationError

from mdr_dask import models
from mdr_dask.campaign.definition import Campaign, Replication, Series
from mdr_dask.campaign.document import TOO_DEEP, Document, parse, read_text
from mdr_dask.campaign.expand import expand
from mdr_dask.campaign.measured import notes
from mdr_dask.campaign.messages import report_errors
from mdr_dask.campaign.problems import Path, shown
from mdr_dask.campaign.spec import AdaptiveSpec, CampaignSpec
from mdr_dask.campaign.tolerances import tolerances
from mdr_dask.campaign.written import units_in
from mdr_dask.errors import CampaignError, DataError, ModelError, did_you_mean
from mdr_dask.models.base import Model
from mdr_dask.units import to_si


def load(path: str | FilePath) -> Campaign:
    """Read a campaign file. File names in the campaign are relative to the folder of the campaign file.

    Problems are raised as a CampaignError with lines such as ``force.yaml:12:12: parameters.hurst: expected ...``.
    """
    return loads(read_text(path), str(path), str(FilePath(path).parent))


def loads(text: str, source: str, directory: str) -> Campaign:
    """Read a campaign from a YAML 1.2 text, called `source` in messages. Names of files are relative to `directory`."""
    document = parse(text, source)
    try:
        return _campaign(document, directory)
    except RecursionError:
        raise CampaignError(f"{document.last()}: {TOO_DEEP}") from None


def _campaign(document: Document, directory: str) -> Campaign:
    if not isinstance(document.data, dict):
        if not document.problems:
            document.report(
                (), f"expected a mapping with the keys 'name', 'model' and 'parameters', got {shown(document.data)}"
            )
        document.problems.raise_if_any()
    spec, wrong = _spec(document, directory)
    model = None if "model" in wrong else _model(document, spec)
    if model is None:
        document.problems.raise_if_any()
    assert model is not None
    series: tuple[Series, ...] = ()
    remarks: tuple[str, ...] = ()
    outputs = _outputs(document, spec, model)
    if not wrong & {"parameters", "series", "sampling"}:
        series, remarks = expand(document, model, spec, directory, outputs)
    replication = _replication(document, spec, model, outputs)
    _check_blocks(document, spec, series)
    measured = spec.measured.table if spec.measured else None
    measured_notes: tuple[str, ...] = ()
    if measured and series:
        try:
            measured_notes = notes(measured, spec.model, outputs, series)
        except DataError as error:
            document.report(("measured", "table"), "; ".join(str(error).splitlines()))
    document.problems.raise_if_any(remarks)
    return Campaign(
        name=spec.name,
        model=spec.model,
        seed=spec.seed,
        replication=replication,
        series=series,
        outputs=outputs,
        accuracy=spec.accuracy,
        store=spec.store.path or f"results/{spec.name}.zarr",
        blocks=dict(spec.store.blocks),
        text=document.text,
        source=document.source,
        remarks=remarks,
        measured=measured,
        measured_notes=measured_notes,
        written_units=units_in(document.data),
    )


def _spec(document: Document, directory: str) -> tuple[CampaignSpec, set[str]]:
    """Return the checked keys and the names of the wrong keys. A wrong key gets a default or a placeholder."""
    wrong: set[str] = set()

    def report(path: Path, what: str, key: bool) -> None:
        wrong.add(str(path[0]))
        document.report(path, what, key)

    context = {"to_si": to_si, "directory": directory}
    try:
        return CampaignSpec.model_validate(document.data, context=context), wrong
    except ValidationError as error:
        report_errors(error, CampaignSpec, document.data, report)
    stand_in: dict[str, Any] = {"name": "unnamed", "model": "none", "parameters": {}}
    stand_in |= {key: value for key, value in document.data.items() if key not in wrong}
    return CampaignSpec.model_validate(stand_in, context=context), wrong


def _model(document: Document, spec: CampaignSpec) -> Model[Any] | None:
    try:
        return models.load(spec.model)
    except ModelError as error:
        document.report(("model",), with_hint(error, spec.model))
    return None


def with_hint(error: ModelError, name: str) -> str:
    """Return a message with a hint: the most similar name of a known model, or the page on writing a model."""
    is_unknown = str(error).startswith("unknown")
    return f"{error}{did_you_mean(name, models.names()) if is_unknown else ' (see docs/own-model.md)'}"


def _outputs(document: Document, spec: CampaignSpec, model: Model[Any]) -> tuple[str, ...]:
    names = [output.name for output in model.outputs]
    errors = {companion.name: name for name, companion in model.companions.items()}
    wanted = spec.outputs or [output.name for output in model.outputs if output.default]
    for index, name in enumerate(spec.outputs or ()):
        path = ("outputs", index)
        if name in errors:
            what = f"expected the output {errors[name]!r} (its error is stored too, except with 'errors: false')"
            document.report(path, f"{what}, got {name!r}")
        elif name in model.parameters.renamed:
            document.report(path, f"{name} has been renamed or removed: {model.parameters.renamed[name]}")
        elif name not in names:
            document.report(path, f"unknown output {name!r}{did_you_mean(name, names)}")
        elif name in wanted[:index]:
            document.report(path, f"this output is given twice: {name}")
    kept = [name for name in names if name in wanted]
    return model.with_companions(kept) if spec.errors else tuple(kept)


def _replication(document: Document, spec: CampaignSpec, model: Model[Any], outputs: tuple[str, ...]) -> Replication:
    wanted = spec.realisations
    if not isinstance(wanted, AdaptiveSpec):
        return Replication(wanted, wanted, {})
    if wanted.at_least > wanted.at_most:
        what = f"expected a whole number of at least {wanted.at_least}, the value of 'at_least', got {wanted.at_most}"
        document.report(("realisations", "at_most"), what)
    until = tolerances(document, ("realisations", "until"), wanted.until, model, outputs)
    return Replication(wanted.at_least, wanted.at_most, until)


def _check_blocks(document: Document, spec: CampaignSpec, series: tuple[Series, ...]) -> None:
    dims = list(dict.fromkeys([*(axis.dim for one in series for axis in one.axes), "realisation"]))
    for name in spec.store.blocks if series else ():
        if name not in dims:
            document.report(("store", "blocks", name), f"unknown dimension{did_you_mean(name, dims)}", key=True)
