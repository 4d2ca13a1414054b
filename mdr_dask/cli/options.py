"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import click

from mdr_dask.cli.printing import say
from mdr_dask.cli.writing import FIGURES, require_suffix


def tell(sentence: str) -> None:
    """Print a message on stderr, because stdout is for results."""
    say(sentence, err=True)


def _units(_: click.Context, __: click.Parameter, texts: tuple[str, ...]) -> dict[str, str]:
    from mdr_dask.questions.units import parse_units

    return parse_units(texts)


def listed(_: click.Context, __: click.Parameter, texts: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names in texts. A text may contain several names, separated by commas. Dots become ``_``."""
    return tuple(name.strip().replace(".", "_") for text in texts for name in text.split(",") if name.strip())


series_option = click.option("--series", help="Name of a series of the campaign.")
select_option = click.option(
    "--select",
    "selections",
    multiple=True,
    metavar="NAME=VALUES",
    help="Keep only these values or ranges of an axis: 'velocity=1 mm/s..1 m/s', hurst=0.3,0.7; may be repeated.",
)
units_option = click.option(
    "--units",
    multiple=True,
    callback=_units,
    metavar="NAME=UNIT,...",
    help="Units of columns or axes: velocity=km/h,temperature=degC; may be repeated.",
)
where_option = click.option(
    "--where",
    default="",
    metavar="CONDITION",
    help="Keep only rows that meet a condition: 'friction_coefficient > 0.5 and velocity < 3 km/h'.",
)
json_option = click.option("--json", "form", flag_value="json", help="Print one JSON document, with units.")
csv_option = click.option("--csv", "form", flag_value="csv", help="Print comma-separated values.")
limit_option = click.option(
    "--limit",
    type=click.IntRange(min=0),
    default=40,
    show_default=True,
    help="Largest number of rows to print; 0 for all.",
)
_LOOK = (
    click.option("--size", metavar="WIDTH[xHEIGHT]", help="Size of a figure on paper: 85mm, 85x60mm."),
    click.option("--title", metavar="TEXT", help="Title; '' for none.  [a description; no title with --size]"),
    click.option("--style", metavar="FILE", help="Style file of matplotlib, or the name of one of its styles."),
)


def _figure(_: click.Context, __: click.Parameter, path: Path | None) -> Path | None:
    require_suffix(path, FIGURES)
    return path


def look_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options for the look of figures. The command gets these options as a dictionary `look`."""

    @wraps(command)
    def wrapped(*given: Any, size: str | None, title: str | None, style: str | None, **rest: Any) -> Any:
        return command(*given, look={"size": size, "title": title, "style": style}, **rest)

    for option in reversed(_LOOK):
        wrapped = option(wrapped)
    return wrapped


def figure_options(*names: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Add options for the file of a figure (with `names` such as ``--plot``) and for its look.

    The command gets the arguments `figure` and `look`.
    """

    def add(command: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(command)
        def wrapped(*given: Any, figure: Path | None, look: dict[str, Any], **rest: Any) -> Any:
            if figure is None and any(value is not None for value in look.values()):
                raise click.UsageError(f"--size, --title and --style need {names[0]} FILE")
            return command(*given, figure=figure, look=look, **rest)

        text = "Draw a figure to FILE.png, .pdf or .svg, and write its data to FILE.csv."
        kind = click.Path(path_type=Path)
        return click.option(*names, "figure", metavar="FILE", type=kind, callback=_figure, help=text)(
            look_options(wrapped)
        )

    return add
