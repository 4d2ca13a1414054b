"""The command figures: campaign files to pictures, by way of their stores."""

from __future__ import annotations

from pathlib import Path

import click

from mdr_dask.cli.campaigns import CAMPAIGN
from mdr_dask.cli.results import plot
from mdr_dask.cli.running import run
from mdr_dask.cli.writing import format_option


@click.command()
@click.argument("campaigns", nargs=-1, required=True, type=CAMPAIGN)
@click.option("--output", "-o", default="figures", show_default=True, help="Folder of the figures.")
@format_option
@click.option("--quiet", is_flag=True, help="No progress on stderr.")
@click.pass_context
def figures(context: click.Context, /, campaigns: tuple[Path, ...], output: str, suffix: str, quiet: bool) -> int:
    """Run campaigns, or what is missing of them, and draw every figure that their stores hold data for.

    \b
    mdr-dask figures campaigns/friction_force.yaml campaigns/friction_hurst.yaml -o figures
    """
    from mdr_dask.campaign import load

    codes: list[int] = []
    for path in campaigns:
        codes.append(context.invoke(run, campaign=path, quiet=quiet))
        context.invoke(plot, store=load(path).store, everything=True, output=Path(output), suffix=suffix)
    return max(codes)
