"""Parameters of histories of velocity and load."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from mdr_dask.errors import DataError
from mdr_dask.headings import Column
from mdr_dask.models.base import Parameters, quantity
from mdr_dask.models.data_file import NamedFile, check_in_campaign
from mdr_dask.tables import AGREE, Read, read_table

if TYPE_CHECKING:
    from mdr_dask.physics.transients.elements.loading_history import Piece

Numbers = Annotated[tuple[float, ...], Field(strict=False)]


class Jump(Parameters):
    """One jump of the velocity by the relative change `velocity_change`, after steady sliding."""

    shape: Literal["jump"] = "jump"


class _History(Parameters):
    """Base class of all histories except the jump."""

    start: Literal["steady", "rest"] = Field(
        default="steady",
        description="state before t = 0 under the normal force `normal_force`: steady sliding at the velocity "
        "`velocity`, or rest",
    )


class Steps(_History):
    """Velocity and normal force that change in steps."""

    shape: Literal["steps"]
    times: Numbers = quantity(
        "s", "times, increasing and not negative, at which velocity and force change", usual="1 ms", min_length=1
    )
    velocities: Numbers = quantity("m/s", "velocity after each of the times", usual="100 mm/s", min_length=1)
    forces: Numbers | None = quantity(
        "N",
        "normal force after each of the times; by default, the parameter `normal_force` at all times",
        usual="1 N",
        default=None,
    )

    @model_validator(mode="after")
    def _rows(self) -> Steps:
        times, forces = self.times, self.forces
        if len(self.velocities) != len(times) or (forces is not None and len(forces) != len(times)):
            raise ValueError(f"expected a velocity and a force for each of the {len(times)} times")
        if times[0] < 0 or any(b <= a for a, b in pairwise(times)):
            raise ValueError(f"expected increasing times that are not negative, got {times!r}")
        if forces is not None and min(forces) <= 0:
            raise ValueError(f"expected positive forces, got {forces!r}")
        return self


class Ramp(_History):
    """Velocity and normal force that change linearly, beginning at t = 0, and are constant after the ramp."""

    shape: Literal["ramp"]
    duration: float = quantity("s", "duration of the ramp", usual="4 ms", gt=0)
    velocity: float | None = quantity(
        "m/s",
        "velocity at the end of the ramp; by default the parameter `velocity` of the body",
        usual="100 mm/s",
        default=None,
    )
    force: float | None = quantity(
        "N",
        "normal force at the end of the ramp; by default the parameter `normal_force` of the body",
        usual="1 N",
        default=None,
        gt=0,
    )


class Oscillation(_History):
    """A velocity that oscillates about the parameter `velocity`, and a force that oscillates about `normal_force`."""

    shape: Literal["oscillation"]
    amplitude: float = quantity("m/s", "amplitude of the oscillating velocity", usual="20 mm/s", ge=0)
    frequency: float = quantity("Hz", "frequency of the oscillation", usual="250 Hz", gt=0)
    force_amplitude: float = quantity(
        "N", "amplitude of the oscillating normal force, less than `normal_force`", usual="0.1 N", default=0.0, ge=0
    )


class TableFile(_History):
    """Velocity and normal force from a table, interpolated linearly between rows, and constant after the last row.

    Two rows with the same time give a jump. Without a column of forces, the force is the parameter `normal_force`.
    """

    shape: Literal["table"]
    file: NamedFile = Field(description='table with the columns "time", "velocity" and, optionally, "force"')

    @model_validator(mode="after")
    def _holds_a_history(self, info: ValidationInfo) -> TableFile:
        check_in_campaign(info, lambda: _table_rows(self.file, 1.0))
        return self

    def notes(self) -> tuple[str, ...]:
        """Return a note on the columns and lines of the table that are not used."""
        remark = _table(self.file).remark
        return (f"table {self.file.name}: {remark}",) if remark else ()


Protocol = Annotated[Jump | Steps | Ramp | Oscillation | TableFile, Field(discriminator="shape")]


def pieces(protocol: Protocol, velocity: float, force: float, change: float) -> tuple[tuple[float, float], list[Piece]]:
    """Return velocity and normal force before t = 0, and the pieces of the history after t = 0.

    `velocity` and `force` are the parameters of the sliding body, and `change` is the relative change of the velocity
    at a jump. The last piece ends at t = infinity. Raise DataError if the protocol contradicts `velocity` or `force`,
    or if its table is wrong.
    """
    from mdr_dask.physics.transients.elements.loading_history import Piece

    if isinstance(protocol, Jump):
        after = velocity * (1 + change)
        return (velocity, force), [Piece(0.0, np.inf, (after, after), (force, force))]
    before = (velocity if protocol.start == "steady" else 0.0), force
    if isinstance(protocol, Oscillation):
        if protocol.force_amplitude >= force:
            raise DataError(f"expected a force_amplitude below the normal force, got {protocol.force_amplitude!r}")
        swing = protocol.amplitude, protocol.force_amplitude, 2 * np.pi * protocol.frequency
        return before, [Piece(0.0, np.inf, (velocity, velocity), (force, force), swing)]
    if isinstance(protocol, Ramp):
        last = (velocity if protocol.velocity is None else protocol.velocity, protocol.force or force)
        rows = [(0.0, *before), (protocol.duration, *last)]
    elif isinstance(protocol, Steps):
        forces = protocol.forces or (force,) * len(protocol.times)
        rows = [(0.0, *before)]
        for time, *then in zip(protocol.times, protocol.velocities, forces, strict=True):
            rows += [(time, rows[-1][1], rows[-1][2]), (time, then[0], then[1])]
    else:
        rows = _table_rows(protocol.file, force)
        if len(rows) > 1 and rows[1][0] == 0 and not np.allclose(rows[0][1:], before, rtol=AGREE, atol=0):
            raise DataError(
                f"{protocol.file.name}: the first of two rows at t = 0 states the velocity and the force before t = 0: "
                f"expected {before[0]:g} m/s and {before[1]:g} N, got {rows[0][1]:g} m/s and {rows[0][2]:g} N; "
                "correct that row, or the parameters `velocity`, `normal_force` and `start`"
            )
    found = [Piece(a[0], b[0], (a[1], b[1]), (a[2], b[2])) for a, b in pairwise(rows) if b[0] > a[0]]
    end = rows[-1]
    return before, [*found, Piece(end[0], np.inf, (end[1], end[1]), (end[2], end[2]))]


def _table(file: NamedFile) -> Read:
    columns = (
        Column("time", "s", least=0),
        Column("velocity", "m/s"),
        Column("force", "N", ("normal force",), needed=False, above=0),
    )
    return read_table(file.read_text(), file.name, columns)


@lru_cache(maxsize=16)
def _table_rows(file: NamedFile, force: float) -> list[tuple[float, float, float]]:
    table = _table(file)
    time, velocity = table["time"], table["velocity"]
    load = table.get("force", np.full(time.size, force))
    if time[0] != 0 or np.any(np.diff(time) < 0):
        raise DataError(f"{file.name}: expected times that start at 0 and do not decrease")
    return [(float(t), float(v), float(f)) for t, v, f in zip(time, velocity, load, strict=True)]
