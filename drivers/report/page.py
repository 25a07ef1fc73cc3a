"""The report of a run: one page that needs nothing but a browser, made from the results file alone."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from uplift.drivers.report.charts import film_data, line_data
from uplift.drivers.report.history_charts import chart_groups
from uplift.drivers.report.html_page import figures, page, section, table
from uplift.drivers.report.scene_drawing import scene_svg
from uplift.drivers.report.words import extremes, findings, key_values, number, scale_for
from uplift.drivers.results.results import Results, floor_acceleration

NAME = "report.html"

LISTED = 40
"""Contacts whose extremes are listed at most: those with the widest gaps and the largest forces."""

FOOTER = (
    "Displacements are relative to the base and counted from the unloaded plate; contact forces are positive in compression. All values "
    "are those of the results file <code>results.h5</code> beside this page; histories are thinned for drawing, their extremes are exact."
)


def write_report(path: Path, results: Results) -> None:
    """Write the page."""
    path.write_text(report(results), encoding="utf-8")


def report(results: Results) -> str:
    """Return the page as HTML."""
    facts = results.facts
    groups = chart_groups(results)
    snapshots, lines = film_data(results), line_data(results)
    parts = {
        "results": section("results", "Key results", _keys(results)),
        "scene": section("scene", "Scene and signal", _scene(results, groups["signal"])),
        "motion": section("motion", "The motion", _film(results) if snapshots else ""),
        "histories": section("histories", "Histories at the probes", figures(groups["probes"])),
        "contacts": section("contacts", "Contacts", figures(groups["maps"], two=False), _lines(lines), figures(groups["uplift"])),
        "resultants": section("resultants", "Forces of the ground", figures(groups["reactions"])),
        "energy": section("energy", "Energy", figures(groups["energy"])),
        "spectra": section("spectra", "Floor response spectra", _spectra_words(results), figures(groups["spectra"])),
        "extremes": section("extremes", "Extremes", _extremes(results)),
        "provenance": section("provenance", "Provenance", _provenance(results)),
    }
    titles = {"results": "Key results", "scene": "Scene", "motion": "Motion", "histories": "Histories", "contacts": "Contacts",
              "resultants": "Forces of the ground", "energy": "Energy", "spectra": "Spectra", "extremes": "Extremes",
              "provenance": "Provenance"}
    links = "\n".join(f'<a href="#{key}">{titles[key]}</a>' for key, part in parts.items() if part)
    title = str(facts.get("title") or "Uplift")
    top = f'<h1>{escape(title)}</h1>\n<p class="how">{escape(_how(results))}</p>\n<nav>{links}</nav>'
    main = "\n".join(part for part in parts.values() if part)
    body = f"<header>\n{top}\n{_warnings(results)}\n</header>\n<main>\n{main}\n</main>\n<footer>{FOOTER}</footer>"
    charts = [chart for group in groups.values() for chart in group]
    return page(title, body, {"charts": charts, "film": snapshots, "lines": lines})


def _how(results: Results) -> str:
    facts = results.facts
    methods = {"transient": "Time stepping", "time-frequency": "Sweep over frequencies", "modal": "Time stepping on a modal basis",
               "exact": "Exact time integration"}
    passes = facts.get("iterations")
    how = "uplift solved exactly" if facts.get("uplift") == "exact" else f"{passes} published pass{'' if passes == 1 else 'es'}"
    date = f", run on {str(facts['written'])[:16].replace('T', ' ')} UTC" if facts.get("written") else ""
    method = methods.get(str(facts.get("method")), facts.get("method"))
    return f"{method}, {how}; {facts.get('dofs')} dofs, {facts.get('contacts')} contacts{date}"


def _warnings(results: Results) -> str:
    words = findings(results)
    if not words:
        return '<p class="calm" id="warnings">No warnings.</p>'
    items = "".join(f"<li><b>{escape(severity.capitalize())}.</b> {escape(text)}</li>" for severity, text in words)
    return f'<div class="warnings" id="warnings"><h2>To be known before these results are used</h2><ul>{items}</ul></div>'


def _keys(results: Results) -> str:
    tiles = [
        f'<div><dt>{escape(key.what)}</dt><dd data-key="{escape(key.what, quote=True)}"><span>{escape(key.value)}</span>'
        f"<small>{escape(key.where)}</small></dd></div>"
        for key in key_values(results)
    ]
    return f'<dl class="keys">{"".join(tiles)}</dl>' if tiles else ""


def _scene(results: Results, signal: list[dict[str, Any]]) -> str:
    drawing = scene_svg(results)
    spans = []
    if len(results.points.get("contacts", ())):
        spans.append("<span><b>blue</b> supports that push and cannot pull</span>")
    if len(results.points.get("springs", ())):
        spans.append("<span><b>ochre</b> plain springs</span>")
    if len(results.points.get("bonded", ())):
        spans.append("<span><b>black</b> bonded supports</span>")
    spans.append("<span><b>orange dot</b> probe</span>")
    figure = f'<figure>{drawing}<div class="key">{"".join(spans)}</div></figure>' if drawing else ""
    return f'<div class="two">{figure}<div>{figures(signal, two=False)}{_model_table(results)}</div></div>'


def _model_table(results: Results) -> str:
    scene = results.facts.get("scene", {})
    rows: list[list[str]] = []

    def add(what: str, value: Any, unit: str = "") -> None:
        if value is not None:
            text = f"{value:,.6g}" if isinstance(value, float) else str(value)
            rows.append([escape(what), escape(f"{text} {unit}".strip())])

    plate, mesh = scene.get("plate", {}), scene.get("mesh", {})
    names = {"young": ("Young's modulus", "Pa"), "poisson": ("Poisson's ratio", ""), "density": ("Density", "kg/m³"),
             "thickness": ("Thickness", "m"), "alpha": ("Damping, stiffness part", "s"), "beta": ("Damping, mass part", "1/s")}
    for key, (what, unit) in names.items():
        add(what, plate.get(key), unit)
    add("Mass", results.facts.get("mass_kg"), "kg")
    if "nx" in mesh and "ny" in mesh:
        add("Mesh", f"{mesh['nx']} × {mesh['ny']} {mesh.get('cell', '')}s of degree {mesh.get('degree', 1)}")
    gravity = scene.get("gravity", {})
    add("Gravity", gravity.get("acceleration") if isinstance(gravity, dict) else None, "m/s²")
    return table(["", ""], rows, "plain") if rows else ""


def _film(results: Results) -> str:
    return """<canvas id="film" role="img" aria-label="The plate on its supports, moving"></canvas>
<div class="state"><b id="filmtime"></b><span id="filmopen"></span><span id="filmground"></span></div>
<div class="controls">
<button id="play" type="button" aria-pressed="false">Play</button>
<label class="wide">time <input id="frame" type="range" min="0" value="0" step="1"></label>
<label>deformation <input id="factor" type="range" min="0" step="1"> <output id="factorvalue" for="factor"></output></label>
<label>speed <select id="speed"><option value="1">real time</option><option value="0.5">1/2</option>
<option value="0.25" selected>1/4</option><option value="0.1">1/10</option><option value="4">4 times</option></select></label>
</div>
<p class="note">Full triangle: contact closed, with the arrow of its force. Open triangle: contact open, with its gap. """ + (
        f"Displacements are relative to the base; {len(results.plate.rows) if results.plate else 0} frames. "
        "A click on a history moves to its instant.</p>"
    )


def _lines(lines: list[dict[str, Any]]) -> str:
    for line in lines:
        line["title"] = f"Force per length along {line['name']}"
    inner = "".join(f'<figure id="pressure-{k}"></figure>' for k in range(len(lines)))
    return f'<div class="two">{inner}</div>' if lines else ""


def _spectra_words(results: Results) -> str:
    if results.spectra is None:
        return ""
    step = results.step
    return (
        '<p class="note">Largest absolute acceleration of oscillators that stand at the probes, within the time of the run. The '
        f"accelerations are taken as linear between the archived instants, {step:.4g} s apart: motion above some "
        f"{number(0.1 / step, 2)} Hz is not resolved; archive more steps where it matters.</p>"
    )


def _extremes(results: Results) -> str:
    rows: list[list[str]] = []
    titles = {
        "probes/displacement": "Displacements", "probes/rotation": "Rotations", "floor": "Absolute accelerations",
        "contacts/force": "Contact forces", "contacts/gap": "Gaps", "uplift/area": "Lifted area", "uplift/contacts": "Open contacts",
        "reactions/force": "Forces of the ground", "reactions/moment": "Moments of the ground", "energy/ledger": "Energies",
        "forces/membrane": "Membrane forces", "forces/moment": "Moments", "forces/shear": "Shear forces", "forces/stress": "Stresses",
        "cuts/force": "Forces of cuts", "cuts/moment": "Moments of cuts",
    }
    tables = {path: (part.names, part.values, part.unit) for path, part in results.series.items()}
    if "probes/acceleration" in results.series:
        tables["floor"] = (*floor_acceleration(results.series), "m/s2")
    for path, title in titles.items():
        if path not in tables:
            continue
        names, values, unit = tables[path]
        scale = scale_for(unit, float(np.nanmax(np.abs(values), initial=0.0)))
        listed = range(len(names))
        if len(names) > LISTED:
            reach = np.max(np.abs(values), axis=0)
            listed = sorted(np.argsort(-reach, kind="stable")[:LISTED].tolist())  # type: ignore[assignment]  # both are iterables of int
            title = f"{title} (the {LISTED} largest of {len(names)})"
        rows.append([f"{title} [{scale.label}]"])
        rounding = 1e-12 * float(np.nanmax(np.abs(values), initial=0.0))
        for i in listed:
            found = extremes(results.times, values[:, i])
            if found is not None:
                low, high = (0.0 if abs(value) < rounding else value / scale.size for value in (found.low, found.high))
                rows.append([escape(names[i]), number(low, 5), f"{found.t_low:.6g}", number(high, 5), f"{found.t_high:.6g}"])
    for path, part in results.series.items():
        if path.startswith("contacts/line force/"):
            scale = scale_for(part.unit, float(np.max(np.abs(part.values), initial=0.0)))
            row, column = np.unravel_index(np.argmax(part.values), part.values.shape)
            rows.append([f"Force per length along {path.split('/')[-1]} [{scale.label}]"])
            rows.append([escape(f"at {part.names[column]}"), "", "", number(float(part.values[row, column]) / scale.size, 5),
                         f"{results.times[row]:.6g}"])
    return table(["", "smallest", "at t [s]", "largest", "at t [s]"], rows)


def _provenance(results: Results) -> str:
    facts = results.facts
    known = {
        "Method": facts.get("method"), "Uplift": facts.get("uplift"), "Dofs": facts.get("dofs"), "Ranks": facts.get("ranks"),
        "Archived instants": f"{len(results.times)}, every {results.step:.6g} s",
        "Contact problems per step": _plain(facts.get("contact_problems_per_step")),
        "Published passes": facts.get("iterations") or None,
        "Ended": facts.get("iteration_ended") or None,
        "Difference of two inverse transforms": _with_unit(facts.get("inverse_transform_check_m"), "m"),
        "Points of the sweep": facts.get("laplace_points") or facts.get("frequencies"),
        "Modes": facts.get("modes"), "Vectors of the basis": facts.get("basis_vectors"),
        "Largest residual of a mode": _plain(facts.get("largest_mode_residual")),
        "Loss of orthonormality": _plain(facts.get("orthonormality")),
        "Processor": facts.get("processor"), "Written": facts.get("written"),
    }
    transient = facts.get("scene", {}).get("transient", {})
    if isinstance(transient, dict):
        for key, unit in (("method", ""), ("step", "s"), ("duration", "s"), ("every", ""), ("beta", ""), ("gamma", ""), ("start", "")):
            if key in transient:
                known[f"transient.{key}"] = f"{transient[key]} {unit}".strip()
    rows = [[escape(what), escape(str(value))] for what, value in known.items() if value is not None]
    norms = facts.get("iteration_norms", {})
    shown = {"displacement_change": "Change of the last pass, relative", "tension_left": "Tension left, of the largest compression"}
    for key, what in shown.items():
        if norms.get(key):
            rows.append([what, f"{norms[key][-1]:.2e}"])
    rows += [[escape(name), escape(str(version))] for name, version in facts.get("versions", {}).items()]
    seconds = facts.get("seconds", {})
    longest = max(seconds.values(), default=0.0)
    bars = [[escape(name), f'{s:.3f} s <span class="bar" style="width:{90 * s / longest if longest else 0:.0f}px"></span>']
            for name, s in seconds.items()]
    # The scene belongs to the record; most readers do not need it open.
    scene = f"<details><summary>Scene file</summary><pre>{escape(results.scene_text)}</pre></details>" if results.scene_text else ""
    columns = f'<div class="two"><div><h3>Run</h3>{table(["", ""], rows, "plain")}</div><div><h3>Seconds by phase</h3>'
    return columns + f'{table(["", ""], bars, "plain")}</div></div>{scene}'


def _plain(value: Any) -> str | None:
    return None if value is None else number(float(value), 3)


def _with_unit(value: Any, unit: str) -> str | None:
    return None if value is None else f"{float(value):.1e} {unit}"
