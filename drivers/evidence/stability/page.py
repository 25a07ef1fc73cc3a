"""The page of the stability table and its CSV file."""

from __future__ import annotations

import csv
import datetime
import io
import math
from dataclasses import dataclass
from itertools import groupby

from uplift.drivers.evidence.stability.bench import Finding
from uplift.drivers.evidence.stability.cases import Case
from uplift.drivers.results.folder import processor, versions

PRECISE = 1e-7
"""Figures below this are round-off: they are printed as the power of ten that they stay below."""


@dataclass(frozen=True)
class Row:
    """A case and what it gave."""

    case: Case
    finding: Finding

    @property
    def limit(self) -> float:
        """The limit, which may follow from the numbers of the case."""
        return self.case.limit if self.finding.limit is None else self.finding.limit

    @property
    def holds(self) -> bool:
        """The verdict."""
        return self.finding.sound and self.finding.figure <= self.limit

    @property
    def of_yes_or_no(self) -> bool:
        """Whether the case has no figure but only happens or not."""
        return self.case.limit == 0

    def shown(self) -> str:
        """Return the figure as printed: two digits, or the power of ten above what is round-off."""
        value = self.finding.figure
        if self.of_yes_or_no:
            return "yes" if value == 0 and self.finding.sound else "no"
        if math.isnan(value):
            return "none"
        if value >= PRECISE:
            return f"{value:.1e}"
        power = math.ceil(math.log10(3 * max(value, 1e-17)))
        return f"< 1e{power:03d}" if not self.holds or 10.0**power < self.limit else f"< {self.shown_limit()}"

    def shown_limit(self) -> str:
        """Return the limit as printed."""
        return "yes" if self.of_yes_or_no else f"{self.limit:.0e}"

    def verdict(self) -> str:
        """Return the verdict in a word."""
        return "holds" if self.holds else "**FAILS**"

    def line(self) -> str:
        """Return one line for the terminal."""
        return f"{'ok  ' if self.holds else 'FAIL'} {self.case.group}: {self.case.name}: {self.shown()} (limit {self.shown_limit()})"


INTRODUCTION = """# Stability: stiff, extreme and ill-posed cases

Each row of this page drives the reference case (SDLS119: a plate of 4 m x 8 m and 80 t on five supports that push and cannot pull, shaken
sideways for five seconds) to an extreme in one respect, and compares what comes out with something that does not come from the solvers.
Four kinds of oracle serve:

- **An independent model.** The same plate, written down a second time: its elements integrated by hand, its matrices dense, all numbers
  with 64 bits of mantissa instead of 53. Its contacts are not bonded and released, as in the solvers, but absent, and pressed by forces
  that follow from the law of contact. It makes the same time steps, so that what differs is round-off, or a mistake.
- **A closed form** or **an invariant**: an oscillator, free fall, the angle by which a time step turns a mode, the ledger of energies.
- **A law of scaling**: other units, another thickness, another amplitude must give the same answer in other numbers.
- **Another method**, which shares no step with the first.

The figure is the largest difference over all instants, displacements of P3 and contact forces, each relative to its largest value; the
displacements of the static state and the motion from it count apart, so that the one cannot hide the other. What is ill-posed has no
figure: it must be refused, in words of mechanics. The limit of {round_off:g} that many rows share is chosen so that a stiffness which is
wrong in its seventh digit exceeds it, four orders above what a run without any extreme leaves. Figures below {precise:g} are given as the
power of ten that they stay below by a factor of three at least, or as their limit.

*Condition* is that of the matrix of a time step, largest over smallest eigenvalue; *scaled*, with its diagonal brought to one. A direct
solution loses as many digits as the second has, whatever the first: large springs on the diagonal cost nothing, nearly equal large numbers
off it do. Where nothing but the condition sets the limit, the row says so.
"""


def page(rows: list[Row], command: str, seconds: float) -> str:
    """Return the page."""
    from uplift.drivers.evidence.stability.bench import ROUND_OFF

    failed = sum(not row.holds for row in rows)
    verdict = f"**All {len(rows)} cases hold.**" if not failed else f"**{failed} of {len(rows)} cases fail.**"
    known = ", ".join(f"{name} {version}" for name, version in versions().items())
    made = f"Made by `{command}` on {datetime.date.today().isoformat()} in {seconds:.0f} s ({processor()}; {known})."
    parts = [INTRODUCTION.format(round_off=ROUND_OFF, precise=PRECISE).strip(), made, verdict]
    for group, members in groupby(rows, key=lambda row: row.case.group):
        parts.append(f"## {group}")
        parts.append(_table(list(members)))
    return "\n\n".join(parts) + "\n"


def _table(rows: list[Row]) -> str:
    """Return the table of one group; what all its rows have in common stands above it."""
    refusals = all(row.of_yes_or_no for row in rows)
    common = len({row.case.what for row in rows}) == 1
    header = ["case", "refused", "verdict"] if refusals else ["case", "figure", "limit", "verdict"]
    header += [] if common else ["what is done"]
    lines = [[*header, "notes"], ["---"] * (len(header) + 1)]
    for row in rows:
        limit = "yes" if row.of_yes_or_no else f"{row.shown_limit()}, {row.case.origin}"
        cells = [row.case.name, row.shown(), *([] if refusals else [limit]), row.verdict(), *([] if common else [row.case.what])]
        lines.append([*cells, row.finding.note.replace("|", "\\|")])
    text = "\n".join("| " + " | ".join(cells) + " |" for cells in lines)
    return f"{rows[0].case.what[0].upper()}{rows[0].case.what[1:]}.\n\n{text}" if common else text


def csv_text(rows: list[Row]) -> str:
    """Return the table as CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["group", "case", "figure", "limit", "origin of the limit", "verdict", "what is done", "notes"])
    for row in rows:
        verdict = "holds" if row.holds else "fails"
        origin = row.case.origin
        writer.writerow([row.case.group, row.case.name, row.shown(), row.shown_limit(), origin, verdict, row.case.what, row.finding.note])
    return text.getvalue()
