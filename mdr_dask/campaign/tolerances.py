"""Read the tolerances of a campaign, and check that the tolerances fit the outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from mdr_dask.campaign.definition import Refinement, Spread, Tolerance
from mdr_dask.campaign.document import Document
from mdr_dask.campaign.messages import report_errors, value_at
from mdr_dask.campaign.problems import Path
from mdr_dask.campaign.spec import RefinedSpec, ToleranceSpec
from mdr_dask.errors import did_you_mean
from mdr_dask.models.base import Model
from mdr_dask.units import to_si

Written = float | str | ToleranceSpec


def tolerances(
    document: Document,
    path: Path,
    given: Mapping[str, Written],
    model: Model[Any],
    outputs: Sequence[str],
) -> dict[str, Tolerance]:
    """Return the tolerance of each output in SI, and report unknown names and wrong tolerances."""
    known = [output.name for output in model.outputs if output.name in outputs]
    found = {}
    for name, written in given.items():
        at = (*path, name)
        if name not in known:
            document.report(at, f"this is not an output of the campaign{did_you_mean(name, known)}", key=True)
            continue
        try:
            found[name] = tolerance(written, model.output(name).unit)
        except ValueError as error:
            document.report(at, str(error))
    return found


def tolerance(given: Written, unit: str) -> Tolerance:
    """Return a tolerance in SI. Raise ValueError if the tolerance is not positive or its unit does not fit."""
    if isinstance(given, ToleranceSpec):
        absolute = to_si(given.absolute, unit) if isinstance(given.absolute, str) else given.absolute
        found = Tolerance(given.relative, absolute)
    else:
        found = Tolerance(relative=to_si(given, "1") if isinstance(given, str) else given)
    if min(found.relative, found.absolute) < 0 or found == Tolerance():
        raise ValueError("expected a tolerance above 0")
    return found


def refinement(
    document: Document, path: Path, spread: Spread, model: Model[Any], outputs: Sequence[str]
) -> Refinement | None:
    """Return the refinement of the adaptive axis at a path, or None if it cannot be read. Report all problems."""
    data = value_at(document.data, path)

    def report(inner: Path, what: str, key: bool = False) -> None:
        document.report((*path, *inner), what, key)

    try:
        spec = RefinedSpec.model_validate(data, context={"to_si": to_si})
    except ValidationError as error:
        report_errors(error, RefinedSpec, data, report)
        return None
    if isinstance(spec.until, dict):
        until = tolerances(document, (*path, "until"), spec.until, model, outputs)
        numbers = {name: kept for name, kept in until.items() if not model.output(name).dims}
        for name in until.keys() - numbers.keys():
            report(
                ("until", name),
                "expected an output with a single number for each case, got one with further dimensions",
                key=True,
            )
        return Refinement(spread, numbers, spec.at_most)
    single = [output.name for output in model.outputs if output.name in outputs and not output.dims]
    if not single:
        report(
            ("until",),
            "expected at least one output with a single number for each case, which the adaptive axis needs, got none",
        )
        return None
    try:
        return Refinement(spread, {single[0]: tolerance(spec.until, "1")}, spec.at_most)
    except ValueError as error:
        report(("until",), str(error))
    return None
