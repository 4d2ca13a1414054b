"""The command that runs a campaign."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdr_dask.bars import reporter
from mdr_dask.cli.campaigns import CAMPAIGN, ask
from mdr_dask.cli.log import telling
from mdr_dask.cli.printing import print_json
from mdr_dask.units import seconds

if TYPE_CHECKING:
    from mdr_dask.campaign import Campaign
    from mdr_dask.execute import Part, Progress, Resources


@click.command()
@click.argument("campaign", type=CAMPAIGN)
@click.option("--store", "url", help="Path or URL of the store, instead of the one that the file names.")
@click.option("--dry-run", is_flag=True, help="Print what would be computed, and compute nothing.")
@click.option("--threads", type=click.IntRange(min=1), help="Number of threads (default: one per core).")
@click.option("--workers", type=click.IntRange(min=1), help="Number of processes on this machine, instead of threads.")
@click.option("--scheduler", metavar="ADDRESS", help="Use the running Dask scheduler at ADDRESS.")
@click.option(
    "--cluster", type=CAMPAIGN, help="YAML file of the Dask cluster to start: class, arguments, scale or adapt."
)
@click.option(
    "--patience",
    type=click.IntRange(1),
    metavar="SECONDS",
    default=600,
    show_default=True,
    help="Time to wait for workers before giving up.",
)
@click.option("--part", metavar="K/N", help="Run the K-th of N disjoint sets of blocks.")
@click.option(
    "--case-timeout",
    type=click.FloatRange(min=0, min_open=True),
    metavar="SECONDS",
    help="Time limit of one result (a realisation of a case); a slower result is recorded as failed.",
)
@click.option("--retry-failed", is_flag=True, help="Compute results again if they failed or did not converge.")
@click.option(
    "--log", type=click.Path(dir_okay=False, path_type=Path), help="Append the events of the run to FILE as JSON lines."
)
@click.option("--quiet", is_flag=True, help="Print no progress.")
@click.option("--json", "form", flag_value="json", help="Print the outcome as one JSON document.")
def run(campaign: Path, dry_run: bool, log: Path | None, quiet: bool, form: str | None, **options: Any) -> int:
    """Run a campaign: compute all results that the store does not contain yet.

    After an interruption, give the same command again: finished results are kept, and only missing results are
    computed. Exit code 0: all results are done (with --part, those of this part); 1: some results have failed, in this
    run or in an earlier run; 2: the run was refused, or could not go on, for example because a part needs results of
    another part that is not running.

    \b
    mdr-dask run campaigns/quickstart.yaml
    mdr-dask run campaigns/friction_force.yaml --workers 2
    mdr-dask run campaigns/friction_force.yaml --scheduler tcp://head:8786
    mdr-dask run campaigns/friction_force.yaml --part 3/8
    """
    from mdr_dask.campaign import load

    study = load(campaign)
    url = options["url"] or study.store
    if url.startswith("memory:"):
        raise click.UsageError(f"expected a store on a disk or server, not in memory, got {url!r}")
    ask(study)
    if dry_run:
        _print_plan(study, url, form)
        return 0
    from mdr_dask import execute

    resources, part = _resources(options), _part(options["part"])
    about = {"campaign": str(campaign), "store": url, "part": options["part"]}
    with reporter(quiet) as report, telling(quiet, log, **about) as tell:
        progress = execute.run(study, url, resources, report, options["retry_failed"], part, tell)
    what = url if part is None else f"{url}, part {part}"
    what += " (unfinished: it needs results of other parts)" if progress.is_unfinished else ""
    _print_outcome(what, url, progress, form)
    return 2 if progress.is_unfinished else 1 if progress.failed or progress.kept_failed else 0


def _print_plan(study: Campaign, url: str, form: str | None) -> None:
    from mdr_dask import store
    from mdr_dask.plan import estimate
    from mdr_dask.summary import costs_row, study_lines

    kept, to_do = 0, None
    if store.exists(url):
        from mdr_dask.execute import outlook

        progress = outlook(study, url)
        kept, to_do = progress.kept, progress.to_do
        if not to_do and not study.replication.goes_on and form != "json":
            click.echo(f"{url}: all {kept} results are there already; nothing to do")
            return
    costs = estimate(study)
    to_do = costs.results if to_do is None else to_do
    counted = _counted(study, to_do)
    if form == "json":
        of_store = {"counted": counted or "all", "kept": kept, "to_do": to_do}
        print_json({"campaign": study.name, "store": url, **costs_row(costs), **of_store})
        return
    click.echo("\n".join([f"{study.name} -> {url}", *study_lines(study, costs)]))
    if kept:
        left = "" if costs.seconds is None else f": about {seconds(costs.seconds * to_do / costs.results)} on one core"
        what = f"results of the {counted}" if counted else "results"
        click.echo(f"{kept} {what} are in the store already, {to_do} remain{left}")


def _counted(study: Campaign, to_do: int) -> str:
    """Return which results are counted, such as ``first round``, or an empty text if all are counted."""
    if study.replication.goes_on:
        return "first round"
    is_adaptive = any(axis.refinement is not None for series in study.series for axis in series.axes)
    return "values chosen so far" if is_adaptive and to_do else ""


def _resources(options: dict[str, Any]) -> Resources:
    from mdr_dask.campaign.cluster import load_cluster
    from mdr_dask.execute import Resources

    chosen = [name for name in ("threads", "workers", "scheduler", "cluster") if options[name] is not None]
    if len(chosen) > 1:
        raise click.UsageError(f"expected one of --{', --'.join(chosen)}, got {len(chosen)} of them")
    cluster = options["cluster"] and load_cluster(options["cluster"])
    names = ("threads", "workers", "scheduler", "patience", "case_timeout")
    return Resources(**{name: options[name] for name in names}, cluster=cluster)


def _part(text: str | None) -> Part | None:
    from mdr_dask.execute import Part

    if text is None:
        return None
    found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
    number, count = map(int, found.groups()) if found else (0, 0)
    if not 1 <= number <= count:
        raise click.UsageError(f"--part: expected K/N with K from 1 to N, such as 3/8, got {text!r}")
    return Part(number, count)


def _print_outcome(what: str, url: str, progress: Progress, form: str | None) -> None:
    if form == "json":
        from dataclasses import asdict

        print_json({"store": url, **asdict(progress), "failed": progress.failed + progress.kept_failed})
        return
    fresh = progress.done + progress.failed
    if not progress.total:
        click.echo(f"{what}: this part has no block; the study has fewer blocks than parts")
        return
    if not fresh and not progress.not_needed:
        click.echo(f"{what}: all {progress.kept} results are there already; nothing to do")
        _print_failed(url, progress)
        return
    kept = f"{progress.kept} kept, " if progress.kept else ""
    spared = f", {progress.not_needed} not needed" if progress.not_needed else ""
    click.echo(f"{what}: {kept}{progress.done} done, {progress.failed} failed{spared}")
    blocks = "1 block" if progress.blocks == 1 else f"{progress.blocks} blocks"
    solves = "1 solve" if progress.solves == 1 else f"{progress.solves} solves"
    click.echo(
        f"{seconds(progress.wall_seconds)}: {solves}{_shared(progress)} in {blocks}, "
        f"{seconds(progress.compute_seconds)} in the model, {seconds(progress.write_seconds)} writing",
        err=True,
    )
    _print_failed(url, progress)
    if progress.warned:
        click.echo(f"warnings: {progress.warned}: mdr-dask status {url} --messages", err=True)


def _print_failed(url: str, progress: Progress) -> None:
    if progress.kept_failed:
        click.echo(
            f"results that failed in an earlier run: {progress.kept_failed} (--retry-failed computes them again)",
            err=True,
        )
    if progress.failed or progress.kept_failed:
        click.echo(f"list of failed results with reasons: mdr-dask status {url} --failures", err=True)


def _shared(progress: Progress) -> str:
    """Return a text with the fraction of results that needed no solution of their own, or an empty text."""
    share = 1 - progress.solves / max(progress.done, 1)
    return f" ({share:.1%} of the results reused the solve of another result)" if progress.solves and share > 0 else ""
