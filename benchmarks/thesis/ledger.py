"""Studies by which claims of the thesis are tested, and verdicts that come from fits.

A verdict is a text that begins with "yes", "approximately", "no" or "not tested", like `law_holds` of the fits.
"""

from __future__ import annotations

import hashlib
import re
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import xarray as xr

from mdr_dask.campaign import loads
from mdr_dask.execute import Resources, run
from mdr_dask.fits import available
from mdr_dask.fits.base import law_holds
from mdr_dask.store import datasets

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"


@dataclass(frozen=True)
class Studies:
    """Stores of campaigns in a folder, with at most `lines` realisations; each is computed when it is first needed.

    For a quick test, `points` replaces the 5000 Nyquist points of the lines.
    """

    lines: int
    points: int | None = None
    folder: str = field(default_factory=tempfile.mkdtemp)

    def __call__(self, name: str, series: Sequence[str] = (), **replaced: str) -> dict[str, xr.Dataset]:
        """Return series of a campaign (default: all), with some lines ``key: value`` of the campaign replaced.

        A key ``series_NAME`` means the line ``NAME: value`` below ``series:``.
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


def _with_line(text: str, key: str, value: str) -> tuple[str, int]:
    """Return a text with the value of its first line ``key: value`` replaced, and whether there was one."""
    return re.subn(rf"^(\s*){key}: [^#\n]*", rf"\g<1>{key}: {value} ", text, count=1, flags=re.M)


Judge = Callable[[Studies], str]


def word(sentence: str) -> str:
    """Return the word with which a verdict begins."""
    return sentence.partition(":")[0]


def compared(figure: str, *departures: float) -> str:
    """Return the verdict on relative departures without scatter, followed by a text with numbers."""
    return f"{law_holds(np.array(departures), None)}; {figure}"


@dataclass(frozen=True)
class FromFit:
    """A verdict that is the sentence of a fit; with several cases, that of the worst case.

    `sentence` is the variable of the fit that holds the sentence. `constants` are printed with their intervals.
    `within` selects the cases to which the claim refers and `shown` those whose constants are printed, both by label
    along dimensions. `replaced` are lines of the campaign, as in `Studies`.
    """

    campaign: str
    law: str
    series: str = ""
    sentence: str = "law_holds"
    constants: tuple[str, ...] = ()
    within: Mapping[str, object] = field(default_factory=dict)
    shown: Mapping[str, object] = field(default_factory=dict)
    replaced: Mapping[str, str] = field(default_factory=dict)

    def __call__(self, studies: Studies) -> str:
        """Return the sentence of the fit, followed by the constants."""
        groups = studies(self.campaign, (self.series,) if self.series else (), **self.replaced)
        model = next(iter(groups.values())).attrs["model"]
        found = next(iter(available(model)[self.law].results(groups).values()))
        judged = found[self.sentence].sel(_present(self.within, found))
        cases = [_case(judged, index) for index in np.ndindex(judged.shape)]
        case, worst = max(cases, key=lambda each: _RANK.get(word(each[1]), -1))
        if case:
            worst = f"{worst} (at {case})"
        if not self.constants:
            return worst
        part = found.sel(_present(self.shown or self.within, found)).squeeze()
        shown = [_shown(part, name) for name in self.constants]
        return f"{worst}; {'; '.join(shown)}"


_RANK = {"not tested": 0, "yes": 1, "approximately": 2, "no": 3}


def _present(selection: Mapping[str, object], found: xr.Dataset) -> dict[str, object]:
    return {dim: label for dim, label in selection.items() if dim in found.dims}


def _case(judged: xr.DataArray, index: tuple[int, ...]) -> tuple[str, str]:
    """Return a description of one case of an array of sentences, and the sentence."""
    one = judged.isel(dict(zip(judged.dims, index, strict=True)))
    labels = [f"{dim} = {_number(one[dim].item())}" for dim in judged.dims if dim in one.coords]
    return ", ".join(labels), str(one.item())


def _number(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _shown(part: xr.Dataset, name: str) -> str:
    """Return a text with a constant and its interval for every case."""
    ends = [part[name], part.get(f"{name}_low", part[name]), part.get(f"{name}_high", part[name])]
    if part[name].ndim == 0:
        return f"{name} = {_interval(*(float(end) for end in ends))}"
    dim = str(part[name].dims[0])
    each = [
        f"{_interval(*(float(end[k]) for end in ends))} at {dim} = {_number(part[dim].values[k].item())}"
        for k in range(part.sizes[dim])
        if np.isfinite(float(part[name][k]))
    ]
    return f"{name} = {', '.join(each)}"


def _interval(value: float, low: float, high: float) -> str:
    known = np.isfinite(low) and np.isfinite(high) and low < high
    return f"{value:.3g} ({low:.3g}, {high:.3g})" if known else f"{value:.3g}"
