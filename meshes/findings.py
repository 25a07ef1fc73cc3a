"""What a user has to know of an answer: findings, each with a key, a severity and a text with its figure.

A finding is a record of the log with an attribute `finding`. A library user may listen to the logger of this module; the command line
collects them for the console, summary.json, results.h5 and the page (`uplift.drivers.process`).
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

log = logging.getLogger(__name__)

SEVERITIES = ("note", "doubt", "grave")
"""grave: the answer is infinite, unheld or beyond the theory."""


@dataclass(frozen=True)
class Finding:
    """One thing that a user has to know of an answer."""

    key: str
    severity: str
    """One of `SEVERITIES`."""
    text: str

    def __str__(self) -> str:
        """Return it as the console has it."""
        return f"{self.severity}: {self.text}"


@dataclass(frozen=True)
class Kind:
    """A kind of finding."""

    severity: str
    about: str
    """When it is said, for the guide."""


KINDS = {
    "scene": Kind("doubt", "The scene may not mean what it says: no signal, nothing that presses on the supports."),
    "signal": Kind("doubt", "A signal and the time step, the duration or the rows of its record do not fit."),
    "record": Kind(
        "doubt", "The heading of a record names another unit than the scene, or one that the scene leaves open (a note says which is "
        "taken); a record begins before time 0, ends with a jump, is zero or does not act within the run."
    ),
    "overlap": Kind("doubt", "Plates lie on each other; what both cover is there once."),
    "unsettled": Kind("doubt", "The settling steps end away from the state of rest."),
    "wrap-around": Kind("doubt", "The end of the periodic window acts on its beginning."),
    "aliasing": Kind("doubt", "Energy of a load above half the sampling rate comes back at a lower frequency."),
    "cutoff": Kind("doubt", "Energy of a load above the highest frequency that is solved is left out."),
    "modes alone": Kind("doubt", "Contact forces from modes without static answers."),
    "error in time": Kind("doubt", "The time integration is off by more than two percent."),
    "checkpoint": Kind("note", "A checkpoint is missing, replaced or could not be written."),
    "scalars": Kind("note", "Real numbers are computed as complex ones: the real build of PETSc is not there."),
    "failed case": Kind("doubt", "A case of a study or a comparison has no answer."),
}
"""Every finding that can be said, by its key; `docs/guide.md` lists them."""


def finding(key: str, text: str, *, severity: str | None = None) -> Finding:
    """Return a finding of the kind `key`, of its usual severity unless another is given."""
    return Finding(key, severity or KINDS[key].severity, text)


def say(key: str, text: str, *, severity: str | None = None) -> None:
    """Say a finding of the kind `key`: on the console, in summary.json, in results.h5 and on the page."""
    tell(finding(key, text, severity=severity))


def tell(found: Finding) -> None:
    """Say a finding that is there already."""
    log.warning("%s", found, extra={"finding": found})
