"""Write the output files of commands."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import click

FORMATS = ("png", "pdf", "svg")
FIGURES = tuple(f".{name}" for name in FORMATS)
format_option = click.option(
    "--format", "suffix", type=click.Choice(FORMATS), default=FORMATS[0], show_default=True, help="png, pdf or svg."
)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Make the folder of a file to write.

    If writing fails, remove the file and the folders that did not exist before. An OSError without a file name gets the
    name of this file. UsageError is raised if the file is inside a store.
    """
    require_outside(path)
    there = path.exists()
    missing = [folder for folder in path.parents if not folder.exists()]
    try:
        if not path.parent.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException as error:
        if not there and path.exists():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        with suppress(OSError):  # rmdir fails if the folder does not exist or is not empty
            for folder in missing:
                folder.rmdir()
        if isinstance(error, OSError) and error.filename is None:
            error.filename = str(path)
        raise


def require_outside(path: Path) -> None:
    """Raise UsageError for a file inside a store, because an additional file counts as damage."""
    groups = [folder for folder in path.absolute().parents if (folder / "zarr.json").is_file()]
    if groups:
        from mdr_dask.store import is_study  # imported only here, because mdr_dask.store imports Zarr

        for folder in filter(is_study, map(str, groups)):
            raise click.UsageError(f"expected a file outside every store, got {str(path)!r} in the store {folder}")


def require_suffix(path: Path | None, known: tuple[str, ...]) -> None:
    """Raise UsageError for a file with an unknown suffix."""
    if path is not None and path.suffix not in known:
        raise click.UsageError(
            f"expected a file that ends in {', '.join(known[:-1])} or {known[-1]}, got {str(path)!r}"
        )
