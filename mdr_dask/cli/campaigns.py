"""Commands around a campaign file: models, check, schema."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdr_dask.cli.printing import print_json, print_rows
from mdr_dask.cli.writing import writing

if TYPE_CHECKING:
    from mdr_dask.plan import Estimate

CAMPAIGN = click.Path(exists=True, dir_okay=False, path_type=Path)


@click.command()
@click.argument("name", required=False)
@click.option("--json", "form", flag_value="json", help="Print one JSON document.")
def models(name: str | None, form: str | None) -> None:
    """List the models, or the parameters and outputs of one.

    \b
    mdr-dask models
    mdr-dask models sliding_friction
    """
    from mdr_dask import models as room
    from mdr_dask.campaign.reference import output_rows, parameter_rows
    from mdr_dask.errors import ModelError

    if name is None:
        rows = [{"model": known, "summary": room.load(known).summary} for known in room.names()]
        _print_left(rows, form)
        return
    try:
        model = room.load(name)
    except ModelError as error:
        raise click.UsageError(f"{error}; known: {', '.join(room.names())}") from None
    if form == "json":
        print_json({"model": name, "parameters": parameter_rows(model), "outputs": output_rows(model)})
        return
    click.echo(f"{name}: {model.summary}\n\nparameters")
    _print_left(parameter_rows(model), None)
    click.echo("\noutputs")
    _print_left(output_rows(model), None)


def _print_left(rows: list[dict[str, str]], form: str | None) -> None:
    if form == "json":
        print_json(rows)
        return
    widths = {key: max(len(key), *(len(row[key]) for row in rows)) for key in rows[0]}
    for row in [{key: key for key in rows[0]}, *rows]:
        click.echo("  ".join(row[key].ljust(width) for key, width in widths.items()).rstrip())


@click.command()
@click.argument("campaigns", nargs=-1, required=True, type=CAMPAIGN)
@click.option("--json", "form", flag_value="json", help="Print one JSON document.")
def check(campaigns: tuple[Path, ...], form: str | None) -> None:
    """Check campaign files and say what each will cost; all problems at once, exit code 2 if there are any.

    \b
    mdr-dask check campaigns/*.yaml
    """
    from mdr_dask.campaign import load
    from mdr_dask.errors import CampaignError
    from mdr_dask.plan import estimate

    rows, notes, problems = [], [], []
    for path in campaigns:
        try:
            campaign = load(path)
            costs = estimate(campaign)
        except CampaignError as error:
            problems += list(error.args)
            continue
        rows.append({"campaign": str(path), "model": campaign.model, **cost_row(costs)})
        notes += [f"{path}: {note}" for note in costs.notes]
        if form == "json":
            rows[-1]["notes"] = list(costs.notes)
    if rows:
        print_rows(rows, {"bytes": "B", "seconds": "s"}, form or "table")
    if form != "json":
        for note in notes:
            click.echo(note)
    if problems:
        raise CampaignError(*problems)


def cost_row(estimate: Estimate) -> dict[str, Any]:
    """Return what a campaign will cost as one row of a table."""
    return {
        "cases": estimate.cases,
        "realisations": estimate.realisations,
        "at_most": estimate.at_most,
        "results": estimate.results,
        "solves": estimate.solves,
        "blocks": estimate.blocks,
        "bytes": estimate.bytes,
        "seconds": float(estimate.seconds),
    }


@click.command()
@click.option("--output", "-o", type=click.Path(path_type=Path), help="Write it to a file instead of stdout.")
def schema(output: Path | None) -> None:
    """Print the JSON schema of campaign files, for completion and checks in an editor.

    \b
    mdr-dask schema -o campaign.schema.json
    """
    import json

    from mdr_dask.campaign import json_schema

    text = json.dumps(json_schema(), indent=1) + "\n"
    if output:
        with writing(output):
            output.write_text(text)
    else:
        click.echo(text, nl=False)
