"""From an analysis to its results."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from uplift.drivers.analysis.snapshots import vectors_in_space
from uplift.drivers.results.contact_lines import contact_lines
from uplift.drivers.results.internal_forces import columns_of, series_of
from uplift.drivers.results.results import Results, Series, floor_spectra
from uplift.forms.assembly.points import in_words
from uplift.forms.assembly.reactions import BY_GROUP
from uplift.forms.contact.supports import TRANSLATIONS
from uplift.forms.operators import OutputGroup

if TYPE_CHECKING:
    from uplift.drivers.analysis.assembled_scene import Analysis, AssembledScene
    from uplift.drivers.analysis.snapshots import SnapshotData

AXES = "XYZ"


def collect(
    assembly: AssembledScene, analysis: Analysis, snapshot_data: SnapshotData | None, facts: dict[str, Any], scene_text: str
) -> Results:
    """Return the results of a run, on rank 0."""
    model, operators, history = assembly.plate.model, assembly.operators, analysis.final
    series = _motion(assembly, analysis)
    unilateral = [support for support in model.supports if support.unilateral]
    if operators.contacts.names:
        series |= _contacts(assembly, analysis)
    about = f"Their moments about {in_words(assembly.plate.moments_about)}"
    series |= _reactions(operators.reactions, history.reactions, "", about)
    series |= _reactions(operators.outputs[BY_GROUP], history.group(BY_GROUP), " by group", about)
    series |= series_of(columns_of(assembly.plate.forces, history))
    watched = snapshot_data is not None and snapshot_data.watched > 0
    lifted = snapshot_data.lifted if snapshot_data is not None and watched else analysis.lifted
    if lifted is not None:
        about = "Share of the plate's area whose nodes have risen"
        series["uplift/area"] = Series(("lifted area",), "%", lifted[:, None], about)
    if history.ledger is not None:
        ledger = history.ledger
        names = ("kinetic", "strain", "springs", "damped", "work of loads", "numerical")
        columns = (ledger.kinetic, ledger.strain, ledger.springs, ledger.damped, ledger.work, ledger.numerical)
        about = "Energies; work of loads = changes of kinetic + strain + springs, + damped + numerical"
        series["energy/ledger"] = Series(names, "J", np.column_stack(columns), about)
    points = {
        "probes": vectors_in_space([probe.point for probe in model.probes]),
        "contacts": vectors_in_space(operators.contacts.points),
        "springs": vectors_in_space([p for spring in model.springs for p in spring.points]),
        "bonded": vectors_in_space([p for support in model.supports if not support.unilateral for p in support.points]),
        "directions": np.array([_direction(s.unilateral) for s in unilateral for _ in s.points]).reshape(-1, 3),
    }
    spectra = floor_spectra(history.times, series)
    return Results(
        facts=facts,
        scene_text=scene_text,
        times=history.times,
        series=series,
        points=points,
        probe_names=tuple(probe.name for probe in model.probes),
        plate=snapshot_data,
        envelopes=analysis.envelopes,
        spectra=spectra,
        spectra_names=series["probes/acceleration"].names if spectra is not None else (),
    )


def _direction(unilateral: str) -> np.ndarray:
    return (-1.0 if unilateral.startswith("-") else 1.0) * np.eye(3)[AXES.index(unilateral[-1])]


def _motion(assembly: AssembledScene, analysis: Analysis) -> dict[str, Series]:
    history, names = analysis.final, assembly.operators.probes.names
    rotations = ~assembly.operators.probes.moving
    series = {}

    def keep(path: str, values: np.ndarray, mask: np.ndarray, unit: str, about: str) -> None:
        if mask.any():
            chosen = tuple(name for name, wanted in zip(names, mask, strict=True) if wanted)
            series[path] = Series(chosen, unit, values[:, mask], about)

    keep("probes/displacement", history.probes, ~rotations, "m", "Displacements relative to the base")
    keep("probes/rotation", history.probes, rotations, "rad", "Rotations relative to the base")
    if history.accelerations is not None:
        keep("probes/acceleration", history.accelerations, ~rotations, "m/s2", "Accelerations relative to the base")
    if analysis.passes.number > 1:
        keep("probes/first pass", analysis.passes.histories[0].probes, ~rotations, "m", "Displacements with every contact bonded")
    model = assembly.plate.model
    points = {probe.name: probe.point for probe in model.probes}
    moved = [name.rsplit(".D", 1) for name, turns in zip(names, rotations, strict=True) if not turns]
    base, ground = np.zeros((len(history.times), len(moved))), np.zeros((len(history.times), TRANSLATIONS))
    for motion in model.motions:
        shaking = motion.signal(history.times)
        ground += np.outer(shaking, motion.direction[:TRANSLATIONS])
        for column, (probe, axis) in enumerate(moved):
            turned = np.cross(motion.direction[TRANSLATIONS:], np.subtract(points[probe], motion.center))
            base[:, column] += shaking * (np.array(motion.direction[:TRANSLATIONS]) + turned)[AXES.index(axis)]
    if moved:
        about = "Acceleration of the base at the probes, which differs from one to another where the base rocks"
        series["probes/base"] = Series(tuple(np.array(names)[~rotations].tolist()), "m/s2", base, about)
    series["ground/acceleration"] = Series(tuple(AXES[:TRANSLATIONS]), "m/s2", ground, "Acceleration of the base along the axes")
    return series


def _contacts(assembly: AssembledScene, analysis: Analysis) -> dict[str, Series]:
    contacts, history = assembly.operators.contacts, analysis.final
    tension = contacts.law.tension(history.elongation)
    force, gap = contacts.law.compression(tension, history.release), history.openings(contacts.law)
    lifted = gap > 0
    series: dict[str, Series] = {
        "contacts/force": Series(contacts.names, "N", force, "Contact forces, compression positive"),
        "contacts/gap": Series(contacts.names, "m", gap, "Openings of the contacts, 0 where closed"),
        "uplift/contacts": Series(("open contacts",), "%", 100.0 * lifted.mean(axis=1, keepdims=True), "Share of the open contacts"),
    }
    groups, first = {}, 0
    for support, stated in zip(assembly.plate.model.supports, assembly.scene.model.supports, strict=True):
        if support.unilateral:
            groups[support.name] = members = np.arange(first, first + len(support.points))
            first += len(support.points)
            if stated.per == "area":
                names = tuple(contacts.names[i] for i in members)
                about = f"Contact force of {support.name} over the area that belongs to each contact"
                pressure = Series(names, "Pa", force[:, members] / support.factors, about)
                series[f"contacts/pressure/{support.name.replace('/', '_')}"] = pressure
    for line in contact_lines(groups, np.asarray(contacts.points)):
        names = tuple(contacts.names[i] for i in line.contacts)
        about = f"Contact force of {line.name} over the length of line that belongs to each contact, half the way to its neighbours"
        series[f"contacts/line force/{line.name.replace('/', '_')}"] = Series(names, "N/m", line.pressure(force), about)
    return series


def _reactions(group: OutputGroup, values: np.ndarray, which: str, moments_about: str) -> dict[str, Series]:
    names, moments = group.names, np.array([unit == "N m" for unit in group.units], dtype=bool)
    parts = ((f"reactions/force{which}", ~moments, "N", f"Resultants of the ground's forces on the plate{which}"),
             (f"reactions/moment{which}", moments, "N m", moments_about))
    return {
        path: Series(tuple(name for name, wanted in zip(names, mask, strict=True) if wanted), unit, values[:, mask], about)
        for path, mask, unit, about in parts
        if mask.any()
    }
