"""The command that draws figures of a store: named figures, and any output against its parameters."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdr_dask.cli.options import look_options, select_option, tell, units_option, where_option
from mdr_dask.cli.printing import print_named, say
from mdr_dask.cli.results import require_known
from mdr_dask.cli.writing import FIGURES, format_option, require_suffix, writing

if TYPE_CHECKING:
    import xarray as xr

    from mdr_dask.plots.base import Plot
    from mdr_dask.plots.figure import Figure
    from mdr_dask.plots.render import Drawn

#: Options that apply only to figures of outputs, because the axes of a named figure are fixed.
OF_OUTPUTS = ("over", "by", "panels", "log")
COMMAND = "mdr_dask.command"
#: Variable that numbers the results of a series; after a selection, it contains the numbers of the selected results.
NUMBER = "number of the result"


class Drawing(click.Command):
    """A command that draws figures. The csv files with the data of the figures state the command line."""

    def parse_args(self, context: click.Context, arguments: list[str]) -> list[str]:
        """Store the command line in `context`, then parse the arguments."""
        context.meta[COMMAND] = shlex.join(["mdr-dask", str(self.name), *arguments])
        return super().parse_args(context, arguments)


@click.command(cls=Drawing)
@click.argument("words", nargs=-1, required=True, metavar="STORE... [NAME...]")
@click.option("--all", "everything", is_flag=True, help="Draw every named figure for which the store has the data.")
@click.option("--over", multiple=True, metavar="AXIS", help="Draw an output against this axis; twice for a map.")
@click.option("--by", default="", metavar="AXIS", help="Axis or sampled parameter that the colours show.")
@click.option("--panels", default="", metavar="AXIS", help="One panel for each value of this axis.")
@click.option("--series", multiple=True, help="Draw only this series; may be repeated.")
@select_option
@where_option
@click.option(
    "--log",
    metavar="[x][y][z]",
    help="Logarithmic axes: some of the letters x, y and z (colours), or none.  [chosen from the data]",
)
@units_option
@click.option("--measured", metavar="FILE", help="Also draw the measured points of this table, with error bars.")
@look_options
@click.option(
    "--output", "-o", type=click.Path(path_type=Path), help="File of a single figure, or folder of several figures."
)
@format_option
@click.pass_context
def plot(
    context: click.Context,
    /,
    words: tuple[str, ...],
    everything: bool,
    series: tuple[str, ...],
    selections: tuple[str, ...],
    where: str,
    measured: str | None,
    output: Path | None,
    suffix: str,
    units: dict[str, str],
    look: dict[str, Any],
    **axes: Any,
) -> int:
    """Draw figures by name, or any output against any axis; without a name, list figures, outputs and axes.

    Without --over, an output is drawn against the axis with the most values, or, if the output is itself a curve (such
    as a profile), against the coordinate of this curve. The data of every figure are written to the table FIGURE.csv
    next to the figure. If a study has more axes than a figure can show, each further axis is fixed at one value, which
    is printed. Choose another value with --select. Several stores can be drawn in one figure.

    \b
    mdr-dask plot results/quickstart.zarr velocity -o quickstart.png
    mdr-dask plot results/friction_force.zarr --all -o figures
    mdr-dask plot results/friction_force.zarr velocity --select 'normal_force=1 N'
    mdr-dask plot results/quickstart.zarr friction_coefficient --over velocity --by normal_force --size 85mm -o f.pdf
    mdr-dask plot results/quickstart.zarr friction_coefficient --over velocity --over normal_force -o map.png
    mdr-dask plot results/rubber.zarr velocity --measured rig.csv -o rig.pdf
    """
    from mdr_dask.errors import CodeError, DataError, FitError
    from mdr_dask.plots import page
    from mdr_dask.plots.base import provenance
    from mdr_dask.plots.render import render
    from mdr_dask.questions import selection

    urls, names = _split(words)
    asked = page.requested(**look, units=units)
    notes: dict[str, list[str]] = {}
    is_broken = False
    with page.drawing_for(asked):
        groups = {key: data for url in urls for key, data in _groups(url, urls, series).items()}
        known = _known_to_all(urls, groups)
        if not names and not everything:
            _list(known, groups)
            return 0
        figures = _requested(names, everything, known, groups, axes)
        places = _places(output, list(figures), urls, suffix, alone=len(names) == 1 and not everything)
        require_known([*units], [str(name) for data in groups.values() for name in data.variables], "quantity")
        groups = selection.select_all({key: _numbered(data) for key, data in groups.items()}, selections, tell)
        if where:
            groups = selection.where_all(groups, where)
        warnings = _warnings(urls, series, groups)
        groups = {key: data.drop_vars(NUMBER) for key, data in groups.items()}
        if measured is not None:
            from mdr_dask.plots.measured import with_points

            groups, figures = with_points(groups, figures, measured)
        for (name, figure), path in zip(figures.items(), places, strict=True):
            origin = provenance(name, urls, str(context.meta.get(COMMAND, "")))
            origin |= {"warning": "; ".join(warnings)} if warnings else {}
            try:
                description = figure.describe(groups)
                description.leave_out([f"cases other than {where}"] * bool(where))
                with figure.faults_named():
                    drawn = render(description)
            except (DataError, FitError) as error:
                if not everything:
                    raise
                tell(f"{name}: left out: {error}")
                is_broken |= isinstance(error, CodeError)
                continue
            notes[path.name] = [*_save(drawn, path, origin), *(f"warning: {text}" for text in warnings)]
            click.echo(str(path))
    _tell_notes(notes)
    if warnings:
        tell(f"details of the warnings: mdr-dask status {urls[0]} --messages")
    if unused := units.keys() - asked.used:
        tell(f"--units {', '.join(sorted(unused))}: not shown in any figure that was drawn")
    return 2 if is_broken else 0


def _numbered(data: xr.Dataset) -> xr.Dataset:
    import numpy as np

    status = data["status"]
    return data.assign({NUMBER: (status.dims, np.arange(status.size).reshape(status.shape))})


def _warnings(urls: Sequence[str], series: Sequence[str], groups: Mapping[str, xr.Dataset]) -> list[str]:
    """Return the different warnings of the selected results of each store, with the number of cases that have them.

    `groups` are the selected parts of the series, with the variable `NUMBER`.
    """
    from mdr_dask.questions import progress

    found = []
    for url in urls:
        messages = []
        for key, data in _groups(url, urls, series).items():
            numbers, selected = _numbered(data)[NUMBER].values, {*groups[key][NUMBER].values.ravel().tolist()}
            every = progress.messages(url, str(data.attrs.get("series", "")), data)
            messages += [each for each in every if numbers[tuple(each["place"])] in selected]
        warnings = progress.warnings(messages)
        found += [f"{text} ({count} case{'s' * (count > 1)} of {url})" for text, count in warnings.items()]
    return found


def _split(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the stores at the beginning of the arguments of a command, and the names after the stores."""
    from mdr_dask.store import is_study

    def is_place(word: str) -> bool:
        return word.endswith(".zarr") or is_study(word)

    count = next((k for k, word in enumerate(words) if k and not is_place(word)), len(words))
    return list(words[:count]), list(words[count:])


def _known_to_all(urls: Sequence[str], groups: Mapping[str, xr.Dataset]) -> dict[str, Plot]:
    """Return the figures that exist for all stores."""
    from mdr_dask import plots
    from mdr_dask.store import attributes

    each = [plots.figures_of(str(attributes(url)["model"]), groups) for url in urls]
    return {name: figure for name, figure in each[0].items() if all(name in other for other in each)}


def _list(known: Mapping[str, Plot], groups: Mapping[str, xr.Dataset]) -> None:
    from mdr_dask.plots.view import varied

    print_named([(name, figure.summary) for name, figure in known.items()])
    errors = {array.attrs.get("ancillary_variables") for data in groups.values() for array in data.data_vars.values()}
    outputs = [name for name in _outputs_of(groups) if name not in errors]
    axes = dict.fromkeys(axis for data in groups.values() for axis in varied(data, "status"))
    if outputs and axes:
        say(f"any output can be drawn against any axis, such as {outputs[0]} --over {next(iter(axes))}")
    for title, names in (("outputs", outputs), ("axes", axes)):
        if names:
            say(f"{title}: {', '.join(names)}")


def _outputs_of(groups: Mapping[str, xr.Dataset]) -> list[str]:
    found = (name for data in groups.values() for name in map(str, data.data_vars))
    return [name for name in dict.fromkeys(found) if name != "status"]


def _requested(
    names: Sequence[str],
    everything: bool,
    known: Mapping[str, Plot],
    groups: Mapping[str, xr.Dataset],
    axes: Mapping[str, Any],
) -> dict[str, Plot]:
    """Return the requested figures by name. By default, this name is the last part of the file name of a figure."""
    given = [option for option in OF_OUTPUTS if axes[option]]
    if everything:
        if names or given:
            raise click.UsageError("expected either --all or names of figures and outputs, got both")
        return dict(known)
    of_outputs = [name for name in names if given or name not in known]
    outputs = _outputs_of(groups)
    if given and (fixed := [name for name in names if name in known and name not in outputs]):
        raise click.UsageError(f"--{given[0]} needs an output; the axes of the figure {fixed[0]!r} are fixed")
    require_known(
        of_outputs,
        outputs if given else [*dict.fromkeys([*known, *outputs])],
        "output" if given else "store, figure or output",
    )
    ending = f"-over-{'-'.join(axes['over'])}" if axes["over"] else ""
    return {
        f"{name}{ending}" if name in of_outputs else name: _of_output(name, groups, axes)
        if name in of_outputs
        else known[name]
        for name in names
    }


def _of_output(name: str, groups: Mapping[str, xr.Dataset], axes: Mapping[str, Any]) -> Plot:
    from mdr_dask.plots.view import figure_of

    over = tuple(axis.replace(".", "_") for axis in axes["over"])
    if len(over) > 2:
        raise click.UsageError("expected --over once, or --over twice (for a map)")
    log = axes["log"]
    if log is not None and log != "none" and not set(log) <= set("xyz"):
        raise click.UsageError(f"expected --log with one or more of the letters x, y and z, or 'none', got {log!r}")
    by, panels = (axes[key].replace(".", "_") for key in ("by", "panels"))
    return figure_of(groups, name, over, by, panels, "" if log == "none" else log)


def _groups(url: str, urls: Sequence[str], series: Sequence[str]) -> dict[str, xr.Dataset]:
    """Return the groups of a store by their names in legends. With several stores, each name includes the store."""
    from mdr_dask import store as stores
    from mdr_dask.questions import selection

    groups = stores.datasets(url)
    groups = {name: selection.group(groups, name) for name in series} if series else groups
    if len(urls) == 1:
        return groups
    stems = [Path(each).stem for each in urls]
    store = Path(url).stem if stems.count(Path(url).stem) == 1 else url
    return {f"{store} {name}".strip(): data for name, data in groups.items()}


def save(draw: Callable[[], Figure], path: Path, origin: Mapping[str, str], look: Mapping[str, Any]) -> None:
    """Draw a figure, write it and its table to files, and print the notes on the figure."""
    from mdr_dask.plots import page
    from mdr_dask.plots.render import render

    with page.drawing_for(page.requested(**look)):
        _tell_notes({path.name: _save(render(draw()), path, origin)})
    tell(str(path))


def _save(drawn: Drawn, path: Path, origin: Mapping[str, str]) -> list[str]:
    from mdr_dask.plots import labels, page, render

    drawn.origin = origin
    with writing(render.table_beside(path)), writing(path):
        drawn.save(path)
    asked = page.current()
    if asked.title is not None or asked.width is not None:
        return drawn.description.caption()
    return [labels.plain(note) for note in drawn.description.remarks()]


def _tell_notes(notes: Mapping[str, Sequence[str]]) -> None:
    """Print each note once, after the names of all figures with this note."""
    for note in dict.fromkeys(chain.from_iterable(notes.values())):
        about = [name for name, own in notes.items() if note in own]
        tell(f"{'all figures' if len(about) == len(notes) > 1 else ', '.join(about)}: {note}")


def _places(output: Path | None, names: Sequence[str], urls: Sequence[str], suffix: str, alone: bool) -> list[Path]:
    """Return the path of each figure. Several figures are written into the same folder."""
    folder = output or Path("figures")
    if alone and folder.suffix and not folder.is_dir():
        require_suffix(folder, FIGURES)
        return [folder]
    if folder.suffix in FIGURES and not folder.is_dir():
        raise click.UsageError(f"expected a folder for the figures, got {str(folder)!r}")
    stem = "-".join(Path(url).stem for url in urls)
    return [folder / f"{stem}-{name}.{suffix}" for name in names]
