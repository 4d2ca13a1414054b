"""Commands for campaign files: models, init, check, schema."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdr_dask.bars import at_work
from mdr_dask.cli.options import json_option
from mdr_dask.cli.printing import print_json, print_named, say, terminal_width
from mdr_dask.cli.writing import writing

if TYPE_CHECKING:
    from mdr_dask.campaign import Campaign
    from mdr_dask.models.base import Model

CAMPAIGN = click.Path(exists=True, dir_okay=False, path_type=Path)


@click.command()
@click.argument("name", required=False)
@json_option
def models(name: str | None, form: str | None) -> None:
    """List the models, or the parameters and outputs of one model.

    \b
    mdr-dask models
    mdr-dask models sliding_friction
    """
    from mdr_dask import models
    from mdr_dask.campaign.reference import alternatives_of, number_rows, output_rows, parameter_rows

    if name is None:
        rows = [{"model": known, "summary": models.load(known).summary} for known in models.names()]
        if form == "json":
            print_json(rows)
        else:
            print_named([(row["model"], row["summary"]) for row in rows])
        return
    model = _model(name)
    parameters, outputs, numbers = parameter_rows(model), output_rows(model), number_rows(model)
    together = alternatives_of(model)
    if form == "json":
        rest = {"parameters": parameters, "together": together, "outputs": outputs, "numbers": numbers}
        print_json({"model": name, **rest})
        return
    say(f"{name}: {model.summary}\n\nparameters")
    print_named([(_indented(row["parameter"]), _parameter(row)) for row in parameters])
    if together:
        lines = (click.wrap_text(line, terminal_width(), subsequent_indent="    ") for line in together)
        click.echo("\n".join(["", "exactly one alternative of each line is required", *lines]))
    click.echo("\noutputs")
    print_named([(row["output"], _output(row)) for row in outputs])
    if numbers:
        click.echo("\ndimensionless numbers")
        print_named([(row["number"], f"{row['meaning']}; {row['formula']}") for row in numbers])


def _indented(path: str) -> str:
    """Return the last part of a dotted name, indented by two spaces for each part before the last part."""
    return "  " * path.count(".") + path.rpartition(".")[2]


def _parameter(row: dict[str, str]) -> str:
    """Return the meaning, unit, default and allowed values of a parameter, without the parameters nested in it."""
    words = [word for word in row["allowed"].split(" or ") if not word.startswith("{")]
    default = f"default {row['default']}" if row["default"] not in ("", "required") else row["default"]
    short = re.sub(r"\[([^\]]{9})[^\]]{30,}, ([^,\]]*)\]", r"[\1..., \2]", default)
    return "; ".join(filter(None, [_with_unit(row), short, " or ".join(words)]))


def _output(row: dict[str, str]) -> str:
    """Return the meaning, unit and dimensions of an output, and whether it is optional and has an error."""
    along = row["dimensions"] and f"along {row['dimensions']}"
    missing = "" if row["default"] == "yes" else "only if requested"
    return "; ".join(filter(None, [_with_unit(row), along, missing, row["error"] and "with error"]))


def _with_unit(row: dict[str, str]) -> str:
    return f"{row['meaning']} [{row['unit']}]" if row["unit"] not in ("", "1") else row["meaning"]


def _model(name: str) -> Model[Any]:
    """Return a model, or raise UsageError for an unknown name."""
    from mdr_dask import models
    from mdr_dask.campaign.read import with_hint
    from mdr_dask.errors import ModelError

    try:
        return models.load(name)
    except ModelError as error:
        raise click.UsageError(with_hint(error, name)) from None


@click.command()
@click.argument("model")
@click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path),
    help="Write the campaign to a new file instead of standard output.",
)
def init(model: str, output: Path | None) -> None:
    """Write a first campaign file for a model: parameters with values, units and meanings; optional ones as comments.

    \b
    mdr-dask init sliding_friction -o rubber.yaml
    """
    from mdr_dask.campaign.draft import draft

    text = draft(model, _model(model), str(output or "campaign.yaml"))
    if output is None:
        click.echo(text, nl=False)
        return
    if output.exists():
        raise click.UsageError(f"{output}: this file exists already, expected the name of a new file")
    with writing(output):
        output.write_text(text)
    click.echo(f"{output}: edit it, then run mdr-dask check {output}")


@click.command()
@click.argument("campaigns", nargs=-1, required=True, type=CAMPAIGN)
@json_option
def check(campaigns: tuple[Path, ...], form: str | None) -> None:
    """Check campaign files, and print the axes, the number of results, the size and the computing time of each study.

    All problems of a file are reported at once, with exit code 2.

    \b
    mdr-dask check campaigns/*.yaml
    """
    from mdr_dask.campaign import load
    from mdr_dask.errors import CampaignError
    from mdr_dask.plan import estimate
    from mdr_dask.summary import axes_rows, costs_row, study_lines

    rows, problems = [], []
    for path in campaigns:
        try:
            with at_work(f"checking {path}"):
                campaign = load(path)
                costs = estimate(campaign)
        except CampaignError as error:
            problems += list(error.args)
            continue
        row = {"campaign": str(path), "model": campaign.model, **costs_row(costs)}
        rows.append(row | {"axes": axes_rows(campaign), "questions": list(campaign.remarks)})
        if form != "json":
            say("\n".join([f"{path}: {campaign.model}", *study_lines(campaign, costs)]))
            ask(campaign)
    if rows and form == "json":
        units = {"bytes": "B", "bytes_at_most": "B", "seconds": "s", "seconds_at_most": "s"}
        print_json({"units": units, "rows": rows})
    if problems:
        raise CampaignError(*problems)


def ask(campaign: Campaign) -> None:
    """Print the remarks of a campaign: questions about numbers without a unit, and ignored columns of tables."""
    for question in campaign.remarks:
        say(question, err=True)


@click.command()
@click.option(
    "--output", "-o", type=click.Path(path_type=Path), help="Write the schema to a file instead of standard output."
)
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
