"""What a scene file says of functions of time: the kinds of `signal` of a load."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.scene.toml_table import Table
from uplift.forms.loads.records import RecordChoice, read_record
from uplift.forms.loads.signals import LARGEST, Noise, Ricker, Signal, Sine, Step, Sweep, tabulate
from uplift.forms.loads.signals import Table as TimeTable
from uplift.meshes.checked import Checked, ModelError, quantity

UNITS = ("m/s2", "g", "cm/s2")
"""Of a record; g is the standard acceleration, 9.80665 m/s2."""

LONGEST_TABLE = 1e7
"""Rows of a table that a smooth signal is replaced by, at most."""


@dataclass(frozen=True)
class Tabulated(Checked):
    """A signal replaced by a table of its values, linear between them, as published cases have it."""

    table_step: float | None = quantity("step of the table; none: the smooth signal", "s", default=None, above=0.0, at_most=LARGEST)
    table_digits: int = quantity("significant digits of the table, rounded to nearest", default=17, at_least=1, at_most=17)


@dataclass(frozen=True)
class Record(Checked):
    """A record of times and accelerations in columns of a text file, linear between its rows and zero outside.

    Columns are parted by semicolons, tabs, commas or blanks; the decimal sign is a point, or a comma where commas separate
    nothing. Lines that begin with # % ! or // are remarks, as are lines of words before the numbers. Times stand in the column
    whose heading says so, else in the first. It is interpolated at the instants of the analysis; a run warns where these pass over
    rows or fall between them.
    """

    file: str = quantity("text file beside the scene")
    scale: float = quantity("factor of the values", default=1.0)
    unit: str = quantity("unit of the values in the file; none: what the heading of their column says, else m/s2",
                         default="", one_of=("", *UNITS))
    column: int | str | None = quantity("column of the values, from 1 or by its heading; required where there are more than two",
                                        default=None, at_least=1)


@dataclass(frozen=True)
class Inline(Checked):
    """Values at increasing times, linear between them and zero outside."""

    times: tuple[float, ...] = quantity("times, increasing, at least two", "s")
    values: tuple[float, ...] = quantity("as many values", "m/s2 or 1")

    def check(self) -> None:
        """As many times as values, in order."""
        try:
            TimeTable(np.array(self.times), np.array(self.values))
        except ModelError as error:
            raise ModelError("times", error.message) from None


@dataclass(frozen=True)
class Place:
    """What a signal has to know of the scene around it."""

    folder: Path
    """Where files are looked for."""
    horizon: float
    """Latest time in s that an analysis reaches."""
    ground: bool
    """Whether the values are accelerations of the ground, else factors of a load."""


@dataclass(frozen=True)
class SignalKind:
    """One kind of signal: the dataclasses whose fields are its keys, and what makes the signal of one of each."""

    parameters: tuple[type, ...]
    make: Callable[..., Signal]
    """Called with the place and the parameters; its `ModelError` has the key of the parameter at fault."""


def _itself(place: Place, signal: Signal) -> Signal:
    return signal


def _ricker(place: Place, ricker: Ricker, tabulated: Tabulated) -> Signal:
    if tabulated.table_step is None:
        return ricker
    if not place.horizon / tabulated.table_step <= LONGEST_TABLE:
        raise ModelError("table_step", f"expected > 0 s and at most 1e7 steps, got {tabulated.table_step!r}")
    return tabulate(ricker, tabulated.table_step, place.horizon, tabulated.table_digits)


def _inline(place: Place, inline: Inline) -> Signal:
    return TimeTable(np.array(inline.times), np.array(inline.values))


def _record(place: Place, record: Record) -> Signal:
    choice = RecordChoice(record.column, record.unit, record.scale, place.ground)
    try:
        return read_record(place.folder / record.file, choice)
    except ModelError as error:
        raise ModelError(error.key or "file", error.message) from None


SIGNALS = {
    "ricker": SignalKind((Ricker, Tabulated), _ricker),
    "sine": SignalKind((Sine,), _itself),
    "step": SignalKind((Step,), _itself),
    "sweep": SignalKind((Sweep,), _itself),
    "noise": SignalKind((Noise,), _itself),
    "table": SignalKind((Inline,), _inline),
    "csv": SignalKind((Record,), _record),
}
"""What the key `signal` of a load may say. A format of records is a reader in `uplift.forms.loads` and a line here."""


def read_signal(table: Table, horizon: float, folder: Path, *, ground: bool) -> Signal | None:
    """Take a signal and its parameters out of the table of a load; without the key `signal` the ground's is missing, others have none."""
    name = table.take("signal", str) if ground else table.take("signal", str, default="")
    if not name:
        return None
    if name not in SIGNALS:
        raise ModelError(table.key("signal"), f"expected one of {', '.join(SIGNALS)}, got {name!r:.60}")
    kind = SIGNALS[name]
    parameters: list[Any] = [table.into(one) for one in kind.parameters]
    try:
        return kind.make(Place(folder, horizon, ground), *parameters)
    except ModelError as error:
        raise error.under(table.where) from None
