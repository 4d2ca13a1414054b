"""Commands around a campaign file: models, check, run, schema."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdr_dask.cli.printing import print_json, printable
from mdr_dask.cli.progress import reporter, seconds
from mdr_dask.cli.understood import axes_rows, costs_row, study_lines
from mdr_dask.cli.writing import writing

if TYPE_CHECKING:
    from mdr_dask.campaign import Campaign
    from mdr_dask.execute import Progress, Resources
    from mdr_dask.models.base import Model

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
    from mdr_dask.campaign.reference import number_rows, output_rows, parameter_rows, ways_told

    if name is None:
        rows = [{"model": known, "summary": room.load(known).summary} for known in room.names()]
        _print_left(rows, form)
        return
    model = _model(name)
    if form == "json":
        parts = {"parameters": parameter_rows(model), "together": ways_told(model), "outputs": output_rows(model)}
        print_json({"model": name, **parts, "numbers": number_rows(model)})
        return
    click.echo(f"{name}: {model.summary}\n\nparameters")
    _print_left(parameter_rows(model), None)
    if ways_told(model):
        click.echo("\n".join(["", "what belongs together", *ways_told(model)]))
    click.echo("\noutputs")
    _print_left(output_rows(model), None)
    if model.numbers:
        click.echo("\ndimensionless numbers")
        _print_left(number_rows(model), None)


def _model(name: str) -> Model[Any]:
    """Return a model; a wrong name is a wrong call."""
    from mdr_dask import models as room
    from mdr_dask.errors import ModelError, did_you_mean

    try:
        return room.load(name)
    except ModelError as error:
        hint = did_you_mean(name, room.names()) if str(error).startswith("unknown") else ""
        raise click.UsageError(f"{error}{hint}") from None


@click.command()
@click.argument("model")
@click.option("--output", "-o", type=click.Path(path_type=Path), help="Write it to a new file instead of stdout.")
def init(model: str, output: Path | None) -> None:
    """Write a first campaign of a model, with units, meanings and choices; it passes check as it stands.

    \b
    mdr-dask init sliding_friction -o rubber.yaml
    """
    from mdr_dask.campaign.draft import draft

    text = draft(model, _model(model), str(output or "campaign.yaml"))
    if output is None:
        click.echo(text, nl=False)
        return
    if output.exists():
        raise click.UsageError(f"{output}: exists already, expected the name of a new file")
    with writing(output):
        output.write_text(text)
    click.echo(f"{output}: edit it, then mdr-dask check {output}")


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
    """Check campaign files and say what was understood: axes, tables, sizes, times.

    All problems are told at once, with exit code 2 if there are any.

    \b
    mdr-dask check campaigns/*.yaml
    """
    from mdr_dask.campaign import load
    from mdr_dask.errors import CampaignError
    from mdr_dask.plan import estimate

    rows, problems = [], []
    for path in campaigns:
        try:
            campaign = load(path)
            costs = estimate(campaign)
        except CampaignError as error:
            problems += list(error.args)
            continue
        row = {"campaign": str(path), "model": campaign.model, **costs_row(costs)}
        rows.append(row | {"axes": axes_rows(campaign), "questions": list(campaign.remarks)})
        if form != "json":
            click.echo("\n".join([f"{path}: {campaign.model}", *study_lines(campaign, costs)]))
            _ask(campaign)
    if rows and form == "json":
        print_json({"units": {"bytes": "B", "seconds": "s", "compiling": "s"}, "rows": rows})
    if problems:
        raise CampaignError(*problems)


def _ask(campaign: Campaign) -> None:
    """Print what is asked about bare numbers."""
    for question in campaign.remarks:
        click.echo(printable(question), err=True)


@click.command()
@click.argument("campaign", type=CAMPAIGN)
@click.option("--store", "url", help="Path or URL of the store, instead of the one that the file names.")
@click.option("--dry-run", is_flag=True, help="Say what would be done, and do nothing.")
@click.option("--threads", type=click.IntRange(min=1), help="Threads of this process (default: one per core).")
@click.option("--workers", type=click.IntRange(min=1), help="Start a local Dask cluster of so many processes.")
@click.option("--scheduler", metavar="ADDRESS", help="Use the running Dask scheduler at ADDRESS.")
@click.option("--cluster", type=CAMPAIGN, help="YAML file with class, arguments and scale of any Dask cluster.")
@click.option("--retry-failed", is_flag=True, help="Compute the cases again that failed or did not converge.")
@click.option("--quiet", is_flag=True, help="No progress on stderr.")
@click.option("--json", "form", flag_value="json", help="Print the outcome as one JSON document.")
def run(campaign: Path, dry_run: bool, quiet: bool, form: str | None, **options: Any) -> int:
    """Run a campaign into its store: everything, or what is missing.

    Interrupt it, kill it, run it again: what is in the store is kept, and only the rest is computed.

    \b
    mdr-dask run campaigns/quickstart.yaml
    mdr-dask run campaigns/friction_force.yaml --workers 2
    mdr-dask run campaigns/friction_force.yaml --scheduler tcp://head:8786
    """
    from mdr_dask.campaign import load

    study = load(campaign)
    url = options["url"] or study.store
    if url.startswith("memory:"):
        raise click.UsageError(f"expected a store that outlasts this command, got {url!r}")
    _ask(study)
    if dry_run:
        _print_plan(study, url, form)
        return 0
    from mdr_dask import execute

    resources = _resources(options)
    with reporter(quiet) as report:
        progress = execute.run(study, url, resources, report, options["retry_failed"])
    _print_outcome(url, progress, resources, form)
    return 1 if progress.failed else 0


def _print_plan(study: Campaign, url: str, form: str | None) -> None:
    from mdr_dask import store
    from mdr_dask.plan import estimate

    costs = estimate(study)
    kept, to_do = 0, costs.results
    if store.exists(url):
        from mdr_dask.execute import outlook

        progress = outlook(study, url)
        kept, to_do = progress.kept, progress.to_do
    if form == "json":
        print_json({"campaign": study.name, "store": url, **costs_row(costs), "kept": kept, "to_do": to_do})
        return
    click.echo("\n".join([f"{study.name} -> {url}", *study_lines(study, costs)]))
    if kept:
        left = seconds(costs.seconds * to_do / costs.results)
        click.echo(f"{kept} results are in the store already, {to_do} remain: about {left} on one core")


def _resources(options: dict[str, Any]) -> Resources:
    from mdr_dask.campaign.cluster import load_cluster
    from mdr_dask.execute import Resources

    chosen = [name for name in ("threads", "workers", "scheduler", "cluster") if options[name] is not None]
    if len(chosen) > 1:
        raise click.UsageError(f"expected one of --{', --'.join(chosen)}, got {len(chosen)} of them")
    cluster = options["cluster"] and load_cluster(options["cluster"])
    return Resources(options["threads"], options["workers"], options["scheduler"], cluster)


def _print_outcome(url: str, progress: Progress, resources: Resources, form: str | None) -> None:
    if form == "json":
        from dataclasses import asdict

        print_json({"store": url, **asdict(progress)})
        return
    fresh = progress.done + progress.failed
    if not fresh and not progress.not_needed:
        click.echo(f"{url}: all {progress.kept} results are there already; nothing to do")
        return
    kept = f"{progress.kept} kept, " if progress.kept else ""
    spared = f", {progress.not_needed} not needed" if progress.not_needed else ""
    click.echo(f"{url}: {kept}{progress.done} done, {progress.failed} failed{spared}")
    click.echo(
        f"{seconds(progress.wall_seconds)}: {progress.solves} solves{_shared(progress)} in {progress.blocks} blocks, "
        f"{seconds(progress.compute_seconds)} in the model, {seconds(progress.write_seconds)} writing",
        err=True,
    )
    if progress.failed:
        click.echo(f"which ones, and why: mdr-dask status {url} --failures", err=True)


def _shared(progress: Progress) -> str:
    """Return the share of the results that needed no solve of their own."""
    share = 1 - progress.solves / max(progress.done + progress.failed, 1)
    return f" ({share:.1%} of the results needed none of their own)" if progress.solves and share > 0 else ""


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
