"""Files that commands write."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click

FORMATS = ("png", "pdf", "svg")
format_option = click.option(
    "--format", "suffix", type=click.Choice(FORMATS), default=FORMATS[0], show_default=True, help="png, pdf or svg."
)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Make the folder of a file to be written; if that fails, name the file, and leave none where there was none."""
    there = path.exists()
    try:
        if not path.parent.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException as error:
        if not there and path.exists():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        if isinstance(error, OSError) and error.filename is None:
            error.filename = str(path)
        raise


def figure_file(path: Path) -> Path:
    """Return the path of a figure.

    Raises
    ------
    click.UsageError
        If it does not end as one does.
    """
    if path.suffix[1:].lower() not in FORMATS:
        raise click.UsageError(f"expected a file that ends in .{', .'.join(FORMATS)}, got {str(path)!r}")
    return path
