"""The page of error against run time: advice, references, tables and orders, all from the data of the runs."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from uplift.drivers.evidence.pareto.cases import AS_PUBLISHED, FOURIER, INSTANTS, METHODS, SPREAD, Mesh
from uplift.drivers.evidence.pareto.errors import QUANTITIES, Reference, efficient, errors
from uplift.drivers.evidence.pareto.orders import Observed
from uplift.drivers.evidence.pareto.runs import AGAIN, END, FACTOR_STEP, PASSES, QUICK, Outcome
from uplift.drivers.evidence.peers.peers import OWN, Measured, differences
from uplift.drivers.results.folder import processor, versions
from uplift.drivers.scene.scene import Scene

TOLERANCES = (1e-2, 1e-4, 1e-6)


@dataclass(frozen=True)
class Study:
    """All that the page is made from."""

    scene: Scene
    outcomes: Sequence[Outcome]
    scored: np.ndarray
    """(n_outcomes, 3): errors against the reference of each case, nan where a run failed."""
    units: Mapping[tuple[str, Mesh], float]
    """Seconds of one factorisation by case and mesh."""
    references: Mapping[str, Reference]
    orders: Sequence[Observed]
    peers: Sequence[Measured]
    remarks: Sequence[str]
    """What is to be said of the peers."""
    no_spread: str
    """Why there is no case on spread supports; empty if there is one."""
    command: str
    stem: str
    """Name of the page without its ending, which picture and tables share."""
    seconds: float

    def of(self, case: str) -> list[int]:
        """Return the runs of a case that came to an end."""
        return [i for i, o in enumerate(self.outcomes) if o.run.case == case and o.trace is not None]

    def unit(self, outcome: Outcome) -> float:
        """Return the seconds of one factorisation on the mesh of a run."""
        return self.units.get((outcome.run.case, outcome.run.mesh), float("nan"))


def page(study: Study) -> str:
    """Return the page in Markdown."""
    parts = [*_introduction(study), *_advice_section(study), *_reference_section(study)]
    parts += [part for case in study.references for part in _front_section(study, case)]
    parts += _methods_section(study) + _orders_section(study) + _peers_section(study) + _provenance(study)
    return "\n\n".join(parts) + "\n"


def _paragraph(text: str) -> str:
    return " ".join(text.split())


def _table(header: Sequence[str], rows: Sequence[Sequence[str]], left: int = 1) -> str:
    align = ["---"] * left + ["---:"] * (len(header) - left)
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (header, align, *rows))


def error_words(value: float, floor: float) -> str:
    """Return an error with two digits; below the reference's own error all that is known is that it is not larger."""
    if not np.isfinite(value):
        return ""
    return f"< {floor:.1e}" if value < floor else f"{value:.1e}"


def _words(study: Study, outcome: Outcome) -> str:
    mesh = f" on {outcome.run.mesh.name(study.scene)} cells" if outcome.run.case == SPREAD else ""
    return f"{outcome.run.method}{mesh}, {outcome.run.setting}"


def _introduction(study: Study) -> list[str]:
    probe, scene = study.scene.model.probes[0].name, study.scene
    spread_words = f"""On **spread supports** the same stiffness is spread over the width of the plate, every node of the bottom edge
        standing on its share. Only this case has a limit under refinement: a point load makes a membrane's displacement grow with the
        logarithm of the mesh size. Its errors are those of the mesh, the step and the rest together. The case **{AS_PUBLISHED}** stands
        on points; its errors are those of step, band and basis on the fixed mesh of {Mesh().name(scene)} cells."""
    if study.no_spread:
        points = f"The case stands on points, on the fixed mesh of {Mesh().name(scene)} cells"
        spread_words = f"{points}; no supports are spread ({study.no_spread})."
    return [
        "# Error against run time",
        _paragraph(f"""How long must one compute for how many digits? The plate of the scene "{scene.title}" is computed by every method
            here, on meshes, time steps, bands and basis sizes, and each run is compared with a refined reference that states its own
            error."""),
        _paragraph(spread_words),
        _paragraph(f"""**Errors** are largest differences relative to the largest value: of the displacements of {probe} every
            {INSTANTS:g} s, of the contact forces at the supports as published at the same instants (per metre where supports are
            spread), and, for the uplift, of the time that each of these contacts stays open. **Run time** is wall seconds from the
            assembled model to the histories at every step: initial state, factorisations, basis or sweep, march. Start-up, mesh and
            assembly are apart, the same for all methods. Runs below {QUICK:g} s are made {AGAIN} times, and the median counts. One
            **factorisation** is that of the effective matrix of Newmark's method with a step of {FACTOR_STEP:g} s on the same mesh, in
            real numbers, symbolic and numerical, in the same run of this study."""),
        f"![Error against run time]({study.stem}.png)",
        f"All runs, with their seconds by phase, are in [{study.stem}.csv]({study.stem}.csv).",
    ]


def _advice_section(study: Study) -> list[str]:
    texts = ["## Which method for which tolerance"]
    for case in study.references:
        lines = [f"- *{_tolerance(t)}*: " + " ".join(advice(study, case, t)) for t in TOLERANCES]
        texts += [f"**{_capital(case)}**", "\n".join(lines)]
    return texts


def _capital(words: str) -> str:
    return words[0].upper() + words[1:]


def _tolerance(value: float) -> str:
    return f"{value:.0e}".replace("e-0", "e-")


def _price(study: Study, outcome: Outcome) -> str:
    return f"{_three(outcome.total)} s, {_three(outcome.total / study.unit(outcome))} factorisations"


def _three(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.2g}"


def advice(study: Study, case: str, tolerance: float) -> list[str]:
    """Return two sentences for a tolerance: the quickest run for the displacement, and the quickest for everything."""
    own, reference, probe = study.of(case), study.references[case], study.scene.model.probes[0].name

    def words(i: int) -> str:
        return f"{_words(study, study.outcomes[i])} ({_price(study, study.outcomes[i])})"

    def error(i: int, quantity: int = 0) -> str:
        return error_words(study.scored[i, quantity], reference.error[quantity])

    best = min(own, key=lambda i: study.scored[i, 0])
    if study.scored[best, 0] > tolerance:
        return [f"No run reaches this in {probe}.", f"The nearest is {words(best)}, with an error of {error(best)}."]
    if reference.error[0] > tolerance:
        return [f"No run can be shown to reach this: the reference itself is only known to {reference.error[0]:.1e}.",
                f"The nearest to it is {words(best)}."]
    enough = [i for i in own if study.scored[i, 0] <= tolerance]
    quickest = min(enough, key=lambda i: study.outcomes[i].total)
    first = f"Quickest for {probe} is {words(quickest)}, with an error of {error(quickest)}."
    whole = [i for i in enough if np.all(study.scored[i] <= tolerance)]
    unknown = [name for name, value in zip(QUANTITIES, reference.error, strict=True) if value > tolerance]
    if unknown:
        return [first, f"Of the {' and the '.join(unknown)} the reference is not known well enough to tell."]
    if not whole:
        worst = int(np.argmax(np.min(study.scored[own], axis=0)))
        least = min(own, key=lambda i: study.scored[i, worst])
        return [first, f"No run holds all three quantities to it; the {QUANTITIES[worst]} are at best {error(least, worst)} off."]
    other = min(whole, key=lambda i: study.outcomes[i].total)
    if other == quickest:
        return [first, f"It holds the contact forces ({error(other, 1)}) and the uplift ({error(other, 2)}) to it as well."]
    return [first, f"To hold the contact forces and the uplift to it as well, take {words(other)}."]


def _reference_section(study: Study) -> list[str]:
    probe = study.scene.model.probes[0].name
    rows = [[case, reference.made_of, *(f"{value:.1e}" for value in reference.error)] for case, reference in study.references.items()]
    return [
        "## The references and their own errors",
        _table(["case", "extrapolated from", f"error of {probe}", "of contact forces", "of uplift"], rows, left=2),
        _paragraph("""Richardson extrapolation of second order, twice: from the coarser and from the finer two of three levels. The
            finer one is the reference, the difference of the two the estimate of its error, which is that of the worse one. In the mesh
            and in the step apart, corrections and estimates added, with what the correction in the step changes from one mesh to the
            next as a third part. Errors below the estimate are given as smaller than it."""),
    ]


def _front_section(study: Study, case: str) -> list[str]:
    own, reference = study.of(case), study.references[case]
    front = efficient([study.outcomes[i].total for i in own], [study.scored[i, 0] for i in own])
    rows = [_row(study, own[i], reference) for i in front]
    probe = study.scene.model.probes[0].name
    header = ["method", "mesh", "setting", "dofs", "vectors", "seconds", "factorisations", f"error of {probe}", "contact forces", "uplift"]
    failed = [o for o in study.outcomes if o.run.case == case and o.trace is None]
    texts = [
        f"## Efficient runs: {case}",
        _paragraph(f"""No other run is both quicker and nearer to the reference in {probe}. Runs within the noise of each other's times
            may swap places. Where a smaller basis or a coarser mesh comes nearer than a larger one with the same step, its error
            happens to cancel another."""),
        _table(header, rows, left=3),
    ]
    if failed:
        groups = {method: [o for o in failed if o.run.method == method] for method in dict.fromkeys(o.run.method for o in failed)}
        texts.append(f"Without an answer: {'; '.join(f'{method}: {_failures(group)}' for method, group in groups.items())}.")
    return texts


def _failures(failed: Sequence[Outcome]) -> str:
    ends = dict.fromkeys(o.ended for o in failed)
    return ", ".join(f"{sum(o.ended == end for o in failed)} runs {end}" for end in ends)


def _row(study: Study, i: int, reference: Reference) -> list[str]:
    o = study.outcomes[i]
    return [
        o.run.method, o.run.mesh.name(study.scene), o.run.setting, f"{o.dofs:,}", str(o.vectors or ""), f"{o.total:.3g}",
        _three(o.total / study.unit(o)), *(error_words(v, e) for v, e in zip(study.scored[i], reference.error, strict=True)),
    ]


def _methods_section(study: Study) -> list[str]:
    texts = [
        "## Every method by tolerance",
        _paragraph(f"""Seconds of the quickest run of each method whose error of {study.scene.model.probes[0].name} is below the
            tolerance, its setting, and the smallest error of the method at any price. The published passes end when change and law are
            met to {END:g}, or after {PASSES}; two passes are what the source does."""),
    ]
    for case, reference in study.references.items():
        rows = []
        for method in METHODS:
            own = [i for i in study.of(case) if study.outcomes[i].run.method == method]
            tried = [o for o in study.outcomes if (o.run.case, o.run.method) == (case, method)]
            if not tried:
                continue
            if not own:
                rows.append([method, *[""] * len(TOLERANCES), f"no answer ({_failures(tried)})"])
                continue
            cells = []
            for tolerance in TOLERANCES:
                enough = [i for i in own if study.scored[i, 0] <= tolerance and tolerance >= reference.error[0]]
                best = min(enough, key=lambda i: study.outcomes[i].total, default=None)
                cells.append("-" if best is None else f"{study.outcomes[best].total:.2g} s ({_short(study, study.outcomes[best])})")
            rows.append([method, *cells, error_words(min(study.scored[i, 0] for i in own), reference.error[0])])
        texts += [f"**{_capital(case)}**", _table(["method", *(_tolerance(t) for t in TOLERANCES), "smallest error"], rows)]
    return texts


def _short(study: Study, outcome: Outcome) -> str:
    mesh = f"{outcome.run.mesh.name(study.scene)}, " if outcome.run.case == SPREAD else ""
    return mesh + outcome.run.setting


def _orders_section(study: Study) -> list[str]:
    rows = [
        [row.method, row.case, row.parameter, row.levels, *("-" if not np.isfinite(r) else f"{r:.2f}" for r in row.rates), row.theory]
        for row in study.orders
    ]
    probe = study.scene.model.probes[0].name
    return [
        "## Observed orders beside the theory",
        _paragraph(f"""Least-squares slopes over the finest three levels. For the step, the mesh and the band they are slopes of the
            differences of successive levels, which need no reference; for a basis, of the errors against the run in all dofs with the
            same mesh and step; for the window, of the difference from the longest one, every contact bonded. A contact opens and closes
            within a step and between two nodes, at a place that jumps from level to level: orders of uplift scatter accordingly.
            "{FOURIER}" takes tensions at its samples."""),
        _table(["method", "case", "parameter", "levels", probe, "contact forces", "uplift", "theory"], rows, left=4),
    ]


def _peers_section(study: Study) -> list[str]:
    if not study.peers:
        words = " ".join(study.remarks) or "Not measured in this run; the option `--peers` asks for them."
        return ["## Peers", words]
    reference, apart = study.references[SPREAD], differences(study.peers)
    rows = []
    for m in study.peers:
        score = peer_score(m, reference)
        apart_words = "" if m.program == OWN or (m.program, m.mesh) not in apart else f"{apart[m.program, m.mesh][0]:.1e}"
        scaled = "" if m.measured_steps == m.steps else f" ({m.measured_steps} steps, scaled)"
        rows.append([m.program, m.mesh.name(study.scene), f"{m.dofs:,}", f"{m.preparation:.3g}", f"{m.march:.3g}{scaled}",
                     f"{m.preparation + m.march:.3g}", f"{1e-6 * m.libraries:.0f}", f"{1e-6 * m.peak:.0f}", score, apart_words])
    header = ["program", "mesh", "dofs", "preparation s", "march s", "solution s", "libraries MB", "peak MB", "error",
              "differs from this project"]
    step = 1000 * FACTOR_STEP
    return [
        "## Peers",
        _paragraph(f"""The same problem in other programs, each in a process of its own, one after the other: spread supports, bilinear
            cells, consistent mass, step {step:g} ms, {study.peers[0].steps:,} steps, damping of the plate alone, no point masses
            between support and contact, histories at every step. OpenSeesPy: `quad` elements with the mass of `bbarQuad`, supports of
            the material ENT, Newton's method at every step. Scipy loop: this project's algorithm, exact uplift on one factorisation,
            written in plain numpy and scipy for this mesh only, with the foot held sideways and the joints condensed: the floor.
            Preparation is the model's assembly, initial state and factors, without start-up; memory is that of the whole process, of
            which the libraries take the first figure. The error is that of {study.scene.model.probes[0].name} against the reference
            above, which here is the mesh's; the last column compares the same mesh and step."""),
        _table(header, rows, left=2),
        " ".join([verdict(study.peers), *study.remarks]),
    ]


def peer_score(measured: Measured, reference: Reference) -> str:
    """Return the error of a peer's displacement in words, nothing where it kept no history."""
    return "" if measured.trace is None else error_words(errors(measured.trace, reference.trace)[0], reference.error[0])


def verdict(measured: Sequence[Measured]) -> str:
    """Return in words who is quicker and who needs less memory, mesh by mesh."""
    sentences = []
    own = {m.mesh: m for m in measured if m.program == OWN}
    for program in dict.fromkeys(m.program for m in measured if m.program != OWN):
        ratios = [(own[m.mesh], m) for m in measured if m.program == program and m.mesh in own]
        if not ratios:
            continue
        times = [(here.dofs, (there.preparation + there.march) / (here.preparation + here.march)) for here, there in ratios]
        wins = ", ".join(f"{1 / r:.2g} times at {n:,} dofs" for n, r in times if r < 1)
        loses = ", ".join(f"{r:.2g} times at {n:,} dofs" for n, r in times if r >= 1)
        words = [f"{program} is quicker than this project: {wins}"] if wins else []
        words += [f"{'it' if wins else program} takes longer: {loses}"] if loses else []
        lean = [f"{here.dofs:,}" for here, there in ratios if there.peak < here.peak]
        words += [f"it needs less memory at {', '.join(lean)} dofs"] if lean else []
        sentences.append("; ".join(words) + ".")
    return " ".join(sentences)


def _provenance(study: Study) -> list[str]:
    known = ", ".join(f"{name} {version}" for name, version in versions().items())
    day = datetime.date.today().isoformat()
    return ["---", _paragraph(f"""Made by `{study.command}` on {day} in {study.seconds:.0f} s (1 rank, {processor()}; {known}; the
        sweeps with complex PETSc). Errors come out the same again, times within their noise.""")]
