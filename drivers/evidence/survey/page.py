"""The page of the survey: what the runs gave, in tables and plain words."""

from __future__ import annotations

import datetime
import math

import numpy as np

from uplift.drivers.evidence.survey.cases import AGREEMENT, END, HIGH, IN_TIME, IN_WINDOW, PENALTIES, STIFF, UNBOUNDED
from uplift.drivers.evidence.survey.runs import Chatter, Level, Outcome, order_and_limit, relative
from uplift.drivers.results.folder import processor, versions
from uplift.drivers.scene.scene import Scene
from uplift.solvers.contact.published_passes import RUNAWAY, Passes
from uplift.solvers.history import History


def progress(outcome: Outcome) -> str:
    """Return one line about a case that is done."""
    passes = _ending(outcome.in_time.passes) if outcome.in_time else "cannot"
    return f"{outcome.case.name:<20} transient and Laplace differ by {outcome.difference:.1e}; published passes: {passes}"


def _ending(passes: Passes) -> str:
    if passes.ended == "converged":
        return f"{passes.number}"
    if passes.ended == "diverged":
        return f"diverges after pass {passes.number}"
    return f"not in {passes.number}: change {passes.change[-1]:.0e}, tension left {passes.pull[-1]:.0e}"


def _table(header: list[str], rows: list[list[str]]) -> str:
    align = ["---", *["---:"] * (len(header) - 1)]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (header, align, *rows))


def _instant(scene: Scene, history: History) -> int:
    """Return the step at which values are listed: the last instant that the scene prints, else the end."""
    wanted = scene.output.instants[-1] if scene.output.instants else history.times[-1]
    return int(np.argmin(np.abs(history.times - wanted)))


def _listed(scene: Scene, history: History) -> tuple[float, float, float]:
    """Return DX and DY of the first probe at that instant and its smallest DX, in m."""
    row = _instant(scene, history)
    return float(history.probes[row, 0]), float(history.probes[row, 1]), float(history.probes[:, 0].min())


def _listed_names(scene: Scene, history: History) -> list[str]:
    probe, t = scene.model.probes[0].name, history.times[_instant(scene, history)]
    return [f"{probe} DX({t:.4g} s) [m]", f"{probe} DY({t:.4g} s) [m]", f"{probe} min DX [m]"]


def _paragraph(text: str) -> str:
    return " ".join(text.split())


def introduction(scene: Scene) -> list[str]:
    """Return the paragraphs that say what the page is about."""
    assert scene.transient is not None and scene.fourier is not None
    transient, window = scene.transient, scene.fourier
    return [
        "# Uplift: what the methods give, case by case",
        _paragraph(f"""The reference case is: {scene.title or "a scene without a title"}. The supports push and cannot pull, so the plate
            lifts from them while it rocks. Uplift can be solved exactly: only the contacts are nonlinear, and at every time step a
            small problem of their number is solved beside the linear one. Two methods do that by different means, stepping in time
            (transient) and a sweep over Laplace points with a march over the contact forces (time-frequency). On the same steps they
            have the same answer, so that their difference checks both. The source of the case does otherwise: it solves all times
            with every contact bonded, puts the tensions it finds on the plate as forces, and solves all times again, pass by pass."""),
        _paragraph(f"""This page varies one parameter of the reference case at a time, all else as it is, and shows whether the exact
            methods agree and whether the published passes arrive. Step {transient.step:g} s up to {transient.duration:g} s, from the
            static state; window of the Fourier sweep {window.length:g} s, {window.samples} samples, cut off at {window.cutoff:g} Hz.
            A difference of two histories is the largest over all probes and steps, relative to the largest displacement."""),
    ]


def exact_section(scene: Scene, outcomes: list[Outcome], left_out: list[str]) -> list[str]:
    """Return the section on exact uplift by two methods."""
    header = ["case", *_listed_names(scene, outcomes[0].exact), "contacts open at most", "transient - Laplace"]
    rows = [
        [o.case.name, *(f"{v:.7f}" for v in _listed(scene, o.exact)), f"{o.opened}", f"{o.difference:.1e}{'' if o.case.claimed else ' *'}"]
        for o in outcomes
    ]
    claimed = max(o.difference for o in outcomes if o.case.claimed)
    verdict = "The methods agree" if claimed <= AGREEMENT else "**The methods do not agree**"
    texts = [
        "## Uplift solved exactly",
        _table(header, rows),
        f"{verdict}: the largest difference is {claimed:.1e}, admitted is {AGREEMENT:g}.",
    ]
    if not all(o.case.claimed for o in outcomes):
        texts.append("\\* Not held to that: on supports as stiff as this the scheme itself enlarges round-off, see below.")
    idle = [o.case.name for o in outcomes if o.opened == 0]
    if idle:
        texts.append(f"No contact ever opens in: {', '.join(idle)}. These runs are linear and say nothing about uplift.")
    if left_out:
        texts.append(f"Left out, because they do not fit the scene: {'; '.join(left_out)}.")
    return texts


def passes_section(outcomes: list[Outcome]) -> list[str]:
    """Return the section on the published passes."""
    rows = []
    for o in outcomes:
        if o.in_time is None or o.in_window is None:
            rows.append([o.case.name, "cannot", "", "", "cannot"])
            continue
        run = o.in_time
        off = "" if run.passes.ended == "diverged" else f"{relative(run.passes.final.probes, o.exact.probes):.0e}"
        further = ""
        if run.ended_unbounded:
            number = f"{run.number_unbounded}" if run.ended_unbounded == "converged" else f"not in {run.number_unbounded}"
            further = f"{number}, by way of {run.largest:.0e} m"
        rows.append([o.case.name, _ending(run.passes), off, further, _ending(o.in_window)])
    header = ["case", "passes in time", "off the exact answer", "let run on", "passes by Fourier sweep"]
    check = max((o.in_time.check for o in outcomes if o.in_time), default=0.0)
    texts = [
        "## The published passes",
        _paragraph(f"""Number of passes until both norms are below {END:g}: the change of the displacements from pass to pass (root of the
            sum of squares over the window), and the largest tension left in a contact, relative to the largest compression. At most
            {IN_TIME} passes in time, with the tensions of every step, and {IN_WINDOW} by Fourier sweep. "Diverges after pass k": pass
            k + 1 is more than {RUNAWAY:.0e} times as large as pass 1. One pass: nothing was in tension. "Cannot": the published
            passes do not know how to release a support sideways."""),
        _table(header, rows),
        _paragraph(f"""**Divergence.** In time stepping a force acts on what comes after it and on nothing before. So the passes come
            right from the beginning of the record onwards, and, short of an overflow, enough of them end at the exact answer whatever
            they do on the way. What they do, the column "let run on" shows: the late part of the record grows from pass to pass,
            through the displacement given there, before the correct part reaches it (up to {UNBOUNDED} passes were allowed). That is
            no way to an answer, so it counts as divergence here and makes `run` end with an error. By Fourier sweep the window is
            periodic, its end acts on its beginning, and nothing comes to the rescue. Where that sweep arrives, its answer is the one
            for a band-limited load in that window, near the exact one and not equal to it."""),
        _paragraph("""**Slow passes.** Where the passes do not arrive within the limit, their change from pass to pass can be small all
            the same: compare it with how far off the exact answer they are. Hence the second norm."""),
        _paragraph(f"""The passes in time are superposed from the answers of the time stepping to unit forces, the same linear map and
            much faster; the second pass, made both ways, differs by {check:.0e} at most."""),
    ]
    return texts


def penalty_section(scene: Scene, outcomes: list[Outcome]) -> list[str]:
    """Return the section on the stiffness of what stands for rigid."""
    support = next(support for support in scene.model.supports if support.unilateral)
    own = support.contact[support.axis]
    histories = {o.case.name: o.exact.probes[:, 0] for o in outcomes}
    reference = histories["reference"]
    rows = []
    for name, stiffness in PENALTIES.items():
        if name not in histories or stiffness == own:
            continue
        change = float(np.max(np.abs(histories[name] - reference)) / np.max(np.abs(reference)))
        added = abs(1 / stiffness - 1 / own)
        rows.append([f"{stiffness:.0e}", f"{change:.2e}", f"{added:.2e}", f"{change / added:.2e}"])
    return [
        "## Penalty stiffness",
        _paragraph(f"""The contacts, and the supports sideways, are springs of {own:.0e} N/m that stand for something rigid.
            With another value the DX history may change only by the compliance which that adds to a joint, or takes from it: then the
            ratio of the two is the same in all rows. Round-off, which 1e18 N/m beside 1e8 N/m invites, would spoil it."""),
        _table(["penalty [N/m]", "change of DX", "change of a joint's compliance [m/N]", "ratio [N/m]"], rows),
    ]


def chatter_section(scene: Scene, chatter: list[Chatter]) -> list[str]:
    """Return the section on supports so stiff that contacts chatter."""
    header = ["time integration", _listed_names(scene, chatter[0].exact)[0], "transient - Laplace", "largest contact force [MN]",
              f"largest part above {HIGH:g} Hz [MN]"]
    rows = [
        [c.case.name, f"{_listed(scene, c.exact)[0]:.7f}", f"{c.difference:.0e}", f"{1e-6 * c.force:.3f}", f"{1e-6 * c.high:.3f}"]
        for c in chatter
    ]
    return [
        "## Supports so stiff that contacts chatter",
        _paragraph(f"""With supports of {STIFF["supports.stiffness.Y"]:.0e} N/m a contact is as good as rigid. Average acceleration
            dissipates nothing: what an impact excites at the highest frequencies that the step carries stays in the contact forces,
            contacts open and close with it, and each time round-off is enlarged. Two exact solvers of the same equations then part
            company, and the digits that they do not share mean nothing. Smaller steps do not help: the same happens at higher
            frequencies."""),
        _table(header, rows),
        _paragraph("""Dissipation at high frequency (`method = "hht"` or `"generalised-alpha"` in `[transient]`) makes the problem well
            posed: the two solvers agree again, and the largest contact force hardly depends on the step. The price is a larger error
            of second order in the displacements, which smaller steps take away. The part at high frequency may grow with them: the
            band that is not dissipated widens."""),
    ]


def step_section(scene: Scene, levels: list[Level]) -> list[str]:
    """Return the section on the convergence in the time step."""
    header = ["step [s]", "method", *_listed_names(scene, levels[0].transient), "transient - Laplace"]
    rows = []
    for level in levels:
        rows.append([f"{level.step:g}", "transient", *(f"{v:.7f}" for v in _listed(scene, level.transient)), ""])
        if level.laplace:
            rows.append([f"{level.step:g}", "Laplace", *(f"{v:.7f}" for v in _listed(scene, level.laplace)), f"{level.difference:.1e}"])
    columns = np.array([_listed(scene, level.transient) for level in levels]).T
    orders, limits = zip(*(order_and_limit(column) for column in columns), strict=True)
    rows.append(["order", "", *("" if math.isnan(order) else f"{order:.2f}" for order in orders), ""])
    rows.append(["limit", "", *(f"{limit:.7f}" for limit in limits), ""])
    return [
        "## Convergence in the time step",
        _paragraph("""Average acceleration is of second order. A contact that opens or closes inside a step adds an error of that order
            too, but one that jumps with the place in the step at which it does, so that successive differences fall irregularly. The
            order is the slope of the last three differences; the limit is extrapolated from the last two values with order 2. The
            table of the ground motion stays as it is while the step is halved."""),
        _table(header, rows),
    ]


def provenance(command: str, ranks: int, seconds: float) -> str:
    """Return the line that says how the page was made."""
    known = ", ".join(f"{name} {version}" for name, version in versions().items())
    day = datetime.date.today().isoformat()
    return f"---\n\nMade by `{command}` on {day} in {seconds:.0f} s ({ranks} rank{'s' if ranks > 1 else ''}, {processor()}; {known})."
