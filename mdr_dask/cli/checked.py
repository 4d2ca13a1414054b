"""What a check from Python gives: counts and costs, which print as the lines of ``mdr-dask check``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mdr_dask.cli.campaigns import require_answers
from mdr_dask.cli.understood import study_lines
from mdr_dask.plan import Estimate, estimate

if TYPE_CHECKING:
    from mdr_dask.campaign import Campaign


@dataclass(frozen=True, repr=False)
class Understood(Estimate):
    """What a campaign was understood to be and what it will cost; printed, it is what ``mdr-dask check`` says.

    Attributes
    ----------
    lines : tuple of str
        The axes of each series, what its data hold, what it costs.
    questions : tuple of str
        What is asked about bare numbers far from the usual.
    """

    lines: tuple[str, ...] = ()
    questions: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return "\n".join((*self.lines, *self.questions))


def understood(campaign: Campaign) -> Understood:
    """Return what a campaign was understood to be; CampaignError if it is too large, or waits for what no fit finds."""
    require_answers(campaign)
    costs = estimate(campaign)
    lines = (f"{campaign.name}: {campaign.model}", *study_lines(campaign, costs))
    return Understood(**vars(costs), lines=lines, questions=campaign.remarks)
