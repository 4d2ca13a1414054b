"""Options that several commands share."""

from __future__ import annotations

import click


def tell(sentence: str) -> None:
    """Say something beside the results, on stderr."""
    click.echo(sentence, err=True)


def _units(_: click.Context, __: click.Parameter, texts: tuple[str, ...]) -> dict[str, str]:
    from mdr_dask.questions.units import parse_units

    return parse_units(texts)


series_option = click.option("--series", help="Name of the series, where the campaign has any.")
select_option = click.option(
    "--select",
    "selections",
    multiple=True,
    metavar="NAME=VALUES",
    help="Values and ranges of an axis: 'velocity=1 mm/s..1 m/s', hurst=0.3,0.7; repeat.",
)
units_option = click.option(
    "--units",
    multiple=True,
    callback=_units,
    metavar="NAME=UNIT,...",
    help="Units of columns: velocity=km/h,temperature=degC; repeat.",
)
