"""The command line: the only room that prints or exits."""

from __future__ import annotations

import logging
import os
import signal
import sys

import click

from mdr_dask.cli.campaigns import check, init, models, schema
from mdr_dask.cli.figures import figures, plot
from mdr_dask.cli.fitting import fit
from mdr_dask.cli.law import law
from mdr_dask.cli.master import master_curve
from mdr_dask.cli.printing import printable
from mdr_dask.cli.publishing import publish, report, serve
from mdr_dask.cli.results import aggregate, show, status
from mdr_dask.cli.running import run
from mdr_dask.cli.sensitivity import sensitivity
from mdr_dask.cli.storage import verify
from mdr_dask.cli.surface import surface
from mdr_dask.version import __version__

BROKE = 3
INTERRUPTED = 130


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="mdr-dask")
def cli() -> None:
    """Parameter studies for tribology with the method of dimensionality reduction.

    \b
    mdr-dask init sliding_friction -o mine.yaml  a first campaign to edit
    mdr-dask check campaigns/quickstart.yaml     is the file right, and what will it cost?
    mdr-dask run campaigns/quickstart.yaml       run it, or what is missing of it
    mdr-dask show results/quickstart.zarr        look at results, while it runs too
    mdr-dask plot results/quickstart.zarr        draw the figures
    mdr-dask report results/quickstart.zarr      one page with everything, for any browser

    Completion in bash: eval "$(_MDR_DASK_COMPLETE=bash_source mdr-dask)"; in zsh and fish likewise.
    Exit codes: 0 all done, 1 ran but some cases failed, 2 refused, 3 the program broke, 130 interrupted.
    """


for command in (
    models,
    init,
    check,
    run,
    status,
    verify,
    show,
    aggregate,
    fit,
    sensitivity,
    law,
    plot,
    figures,
    report,
    serve,
    publish,
    master_curve,
    surface,
    schema,
):
    cli.add_command(command)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    from mdr_dask.errors import MdrDaskError

    signal.signal(signal.SIGTERM, _interrupt)
    try:
        result = cli.main(arguments, prog_name="mdr-dask", standalone_mode=False)
        sys.stdout.flush()
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        click.echo("interrupted; nothing is lost: the same command goes on where this one stopped", err=True)
        return INTERRUPTED
    except MdrDaskError as error:
        logging.getLogger("asyncio").setLevel(logging.CRITICAL)  # tasks of Zarr that are given up with it
        click.echo(printable(str(error)), err=True)
        return 2
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        click.echo(f"{error.filename or 'input or output'}: {error.strerror or error}", err=True)
        return 2
    except Exception:
        click.echo(_reported(sys.argv[1:] if arguments is None else arguments), err=True)
        return BROKE
    return result if isinstance(result, int) else 0


def _reported(arguments: list[str]) -> str:
    """Keep what there is to know of a fault of the program itself in a file, and say so in one sentence."""
    import platform
    import tempfile
    import traceback
    from importlib.metadata import version

    names = ("numpy", "scipy", "numba", "dask", "distributed", "zarr", "xarray")
    lines = [f"mdr-dask {' '.join(arguments)}", f"mdr_dask {__version__}, Python {platform.python_version()}"]
    lines += [platform.platform(), ", ".join(f"{name} {version(name)}" for name in names), "", traceback.format_exc()]
    descriptor, path = tempfile.mkstemp(prefix="mdr-dask-", suffix=".txt", text=True)
    with os.fdopen(descriptor, "w") as report:
        report.write("\n".join(lines))
    last = traceback.format_exc().strip().splitlines()[-1]
    return f"a fault of mdr-dask itself, what is in stores is kept: {printable(last)}; please send {path}"


def _interrupt(*_: object) -> None:
    """Treat the word of a batch system at the wall time like Ctrl-C."""
    raise KeyboardInterrupt
