"""What a claim of the thesis is, the studies it is judged on, and the page that lists all of them."""

from __future__ import annotations

import hashlib
import re
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from mdr_dask.campaign import loads
from mdr_dask.execute import Resources, run
from mdr_dask.fits import available
from mdr_dask.store import datasets

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"


class Verdict(StrEnum):
    """What came of a claim."""

    HOLDS = "holds"
    WITHIN = "holds within"
    FAILS = "does not hold"
    NO_DATA = "no data"
    NOT_MODELLED = "not modelled"


class Found(NamedTuple):
    """Our figure for a claim, as the page shows it, and the verdict."""

    figure: str
    verdict: Verdict


@dataclass(frozen=True)
class Studies:
    """Stores of campaigns, each run once when it is first asked for.

    Parameters
    ----------
    lines : int
        Realisations at most.
    points : int or None
        Nyquist points of the lines in place of 5000, for a quick look.
    folder : str
        Where the stores are kept.
    """

    lines: int
    points: int | None = None
    folder: str = field(default_factory=tempfile.mkdtemp)

    def __call__(self, name: str, series: Sequence[str] = (), **replaced: str) -> dict[str, xr.Dataset]:
        """Return the series of a campaign, all or those named, with some of its lines `key: value` replaced.

        A key `series_NAME` stands for the line of a series.
        """
        text = (CAMPAIGNS / f"{name}.yaml").read_text()
        if self.points:
            text = re.sub(r"\bpoints: 5000\b", f"points: {self.points}", text)
        head, mark, tail = text.partition("\nseries:")
        for key, value in replaced.items():
            head, found = _with_line(head, key, value)
            tail, also = (tail, 0) if found else _with_line(tail, key.removeprefix("series_"), value)
            assert found + also == 1, f"{name} has no line {key}"
        text = head + mark + tail
        campaign = loads(text, f"{name}.yaml", str(CAMPAIGNS))
        most = min(self.lines, campaign.replication.at_most)
        least = min(most, campaign.replication.at_least)
        campaign = replace(campaign, replication=replace(campaign.replication, at_least=least, at_most=most))
        if series:
            campaign = replace(campaign, series=tuple(one for one in campaign.series if one.name in series))
        digest = hashlib.sha256(f"{text}{series}".encode()).hexdigest()[:12]
        url = str(Path(self.folder, f"{name}-{digest}.zarr"))
        run(campaign, url, Resources(), lambda _: None)
        return datasets(url)

    def fit(self, name: str, law: str, series: Sequence[str] = (), **replaced: str) -> dict[str, xr.Dataset]:
        """Return the constants that a law has on a campaign, by series."""
        groups = self(name, series, **replaced)
        model = next(iter(groups.values())).attrs["model"]
        return available(model)[law].results(groups)


def _with_line(text: str, key: str, value: str) -> tuple[str, int]:
    """Return a text with the value of its first line `key: value` replaced, and whether there was one."""
    return re.subn(rf"^(\s*){key}: [^#\n]*", rf"\g<1>{key}: {value} ", text, count=1, flags=re.M)


@dataclass(frozen=True)
class Claim:
    """A claim, law, figure or table of the thesis.

    Parameters
    ----------
    item : str
        Its number in the thesis.
    claim : str
        What it says.
    command : str
        How a user sees our figure again.
    judge : callable, Studies -> Found
        Measures and judges it.
    why : str
        One sentence.
    """

    item: str
    claim: str
    command: str
    judge: Callable[[Studies], Found]
    why: str


def told(verdict: Verdict, figure: str = "") -> Callable[[Studies], Found]:
    """Return the judge of a claim that needs no measurement."""
    return lambda _: Found(figure, verdict)


def judged(figure: str, miss: float, holds: float, within: float) -> Found:
    """Judge by how far a figure misses the claim: it holds up to `holds`, and holds within the miss up to `within`."""
    if miss <= holds:
        return Found(figure, Verdict.HOLDS)
    return Found(figure, Verdict.WITHIN if miss <= within else Verdict.FAILS)


def power(x: np.ndarray, y: np.ndarray) -> float:
    """Return the exponent of y over x by least squares in logarithms."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def interval(fitted: xr.Dataset, name: str, digits: int = 3) -> str:
    """Return a constant with its interval: ``0.41 (0.40, 0.42)``."""
    value, low, high = (float(fitted[name + end]) for end in ("", "_low", "_high"))
    known = np.isfinite(low) and np.isfinite(high)
    return f"{value:.{digits}g} ({low:.{digits}g}, {high:.{digits}g})" if known else f"{value:.{digits}g}"


def page(chapters: Iterable[tuple[str, Iterable[Claim]]], studies: Studies) -> str:
    """Return the ledger as Markdown."""
    parts = []
    for title, claims in chapters:
        parts.append(f"## {title}\n\n| item | claim | our figure | verdict | why | command |\n|{'---|' * 6}")
        for claim in claims:
            found = claim.judge(studies)
            command = f"`{claim.command}`" if claim.command else ""
            cells = (claim.item, claim.claim, found.figure, f"**{found.verdict}**", claim.why, command)
            parts.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
        parts.append("")
    return "\n".join(parts)
