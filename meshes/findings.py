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
    helps: str = ""
    """What to do about it."""


KINDS = {
    "scene": Kind(
        "doubt", "The scene may not mean what it says: no signal, nothing that presses on the supports.",
        "another method, or the load that is missing"
    ),
    "signal": Kind(
        "doubt", "A signal and the time step, the duration or the rows of its record do not fit.",
        "a smaller step, a longer run, a step that divides the rows"
    ),
    "record": Kind(
        "doubt", "The heading of a record names another unit than the scene, or one that the scene leaves open (a note says which is "
        "taken); a record begins before time 0, ends with a jump, is zero or does not act within the run.",
        "`unit`, `column`, another file or duration",
    ),
    "overlap": Kind(
        "doubt", "Plates or cells lie on each other; what two plates cover is there once, what two cells cover twice.",
        "see whether that is meant, or mend the mesh",
    ),
    "gap": Kind(
        "doubt", "A free edge of the mesh lies close to a cell without being joined to it.", "give both the same nodes, or `[mesh] merge`"
    ),
    "groups": Kind("note", "A group of the mesh file is not taken as it stands there.", "another name in the mesher"),
    "mesh": Kind("doubt", "The mesh file holds what is left out, or a node that may lie far outside.", "mend the mesh"),
    "free": Kind(
        "note", "A part of the mesh, or all of it, can move as a rigid body in a direction in which nothing holds it.",
        "a spring, or no load that way",
    ),
    "large displacements": Kind(
        "grave", "Displacements or rotations are beyond those that the theory of small displacements describes.",
        "see what holds the plate; another theory",
    ),
    "units": Kind("doubt", "A density, modulus or acceleration of free fall is that of no structure.", "SI units"),
    "soft contact": Kind(
        "doubt", "A contact is softer than the support below it.", "a contact of 1e4 to 1e10 times the support's stiffness"
    ),
    "rocking": Kind("note", "The ground turns about a point that the scene does not name.", "`center_of_rotation`"),
    "instants": Kind("doubt", "Instants of [output] lie beyond the end or between archived ones.", "another duration or `every`"),
    "crowded supports": Kind(
        "doubt", "Several supports or springs along one axis stand on one node, or a hair apart: their stiffnesses add.",
        "see whether that is meant",
    ),
    "thin archive": Kind("doubt", "Largest displacements between archived instants may be more than 1 % larger.", "a smaller `every`"),
    "parts": Kind("doubt", "Parts with a material of their own share cells.", "groups that do not overlap"),
    "normals": Kind("doubt", "A pressure acts on neighbouring cells whose normals point to opposite sides.", "turn cells in the mesher"),
    "unsettled": Kind("doubt", "The settling steps end away from the state of rest.", "more settling steps, or `start = 'static'`"),
    "initial state": Kind(
        "doubt", "A basis misses more than 1 % of the energy of the initial conditions.", "more modes, or all dofs: a run without a basis"
    ),
    "wrap-around": Kind("doubt", "The end of the periodic window acts on its beginning.", "a longer window, or the exact sweep"),
    "aliasing": Kind("doubt", "Energy of a load above half the sampling rate comes back at a lower frequency.", "more samples"),
    "cutoff": Kind("doubt", "Energy of a load above the highest frequency that is solved is left out.", "a higher cutoff"),
    "modes alone": Kind("doubt", "Contact forces from modes without static answers.", "`static_correction = true`"),
    "passes without end": Kind(
        "grave", "The published passes diverge, or have not converged within their number; exit code 1.", "leave out `--iterations`"
    ),
    "tension left": Kind("doubt", "After the published passes that were asked for contacts still pull.", "leave out `--iterations`"),
    "farthest at the end": Kind(
        "doubt", "The largest displacement stands at the end of the run: the peak may lie beyond.", "a longer duration"
    ),
    "flight": Kind("doubt", "All contacts are open at once.", "see whether that is meant; sideways springs still hold the plate"),
    "numerical energy": Kind(
        "doubt", "The time scheme takes away or makes more than 2 % of the energy that loads and start have put in; at impacts on stops "
        "average acceleration, hht and generalised-alpha make it without bound, the more the smaller the step (grave from all of it on).",
        "a smaller step; with impacts the method exact, generalised-alpha with `rho_infinity = 0`, newmark with beta = 0.36, gamma = 0.7",
    ),
    "equilibrium": Kind(
        "doubt", "Loads, inertia and reactions miss each other by more than 1e-6 of the largest force at an archived instant.",
        "a lower stiffness for what is nearly rigid",
    ),
    "picture": Kind("note", "A picture could not be drawn; all other files are there."),
    "checkpoint": Kind("note", "A checkpoint is missing, replaced or could not be written.", "`--resume`, or let it be replaced"),
    "error in time": Kind("doubt", "The time integration is off by more than two percent."),
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


def table() -> str:
    """Return all findings as a table for the guide, in Markdown."""
    rows = [f"| {key} | {kind.severity} | {kind.about} | {kind.helps} |" for key, kind in KINDS.items()]
    return "\n".join(["| key | severity | it is said when | what helps |", "|---|---|---|---|", *rows])
