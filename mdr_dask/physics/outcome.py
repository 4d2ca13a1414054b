"""The outcomes of all solvers, such as CONVERGED or SINGULAR, each with a sentence for users."""

from __future__ import annotations

from enum import IntEnum


class Outcome(IntEnum):
    """Outcome of a solver. Compiled functions return the integer value of the outcome, for example 0 for CONVERGED."""

    CONVERGED = 0
    DEPTH_NOT_FOUND = 1
    OUTSIDE_LINE = 2
    INVALID = 3
    TOO_MANY_STEPS = 4
    SINGULAR = 5
    FILM_COLLAPSED = 6
    STEP_TOO_SMALL = 7
    UNDER_WAY = 8

    @property
    def sentence(self) -> str:
        """Description of the outcome for users."""
        return _SENTENCES[self]

    @property
    def is_impossible(self) -> bool:
        """Whether the parameters of the case are the cause of the failure. A finer grid cannot help then."""
        return self in (Outcome.OUTSIDE_LINE, Outcome.INVALID)


_SENTENCES = {
    Outcome.CONVERGED: "converged",
    Outcome.DEPTH_NOT_FOUND: "the depth at which the contact carries the load was not found",
    Outcome.OUTSIDE_LINE: "the contact leaves the line: a longer line or a smaller load is needed",
    Outcome.INVALID: "load, velocity and line must be finite; the load and the Deborah number must also be positive",
    Outcome.TOO_MANY_STEPS: "too many steps were needed",
    Outcome.SINGULAR: "the linear equations of a step have no unique solution",
    Outcome.FILM_COLLAPSED: "the next step would have closed the film",
    Outcome.STEP_TOO_SMALL: "the steps became too small",
    Outcome.UNDER_WAY: "the solution was not finished",
}
