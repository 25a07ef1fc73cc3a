"""The results of a run, gathered on one rank: what the results file holds and what reports are made of."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from drivers.contact_lines import contact_lines
from forms.supports import TRANSLATIONS
from solvers.spectra import DAMPING, FREQUENCIES, ResponseSpectrum, response_spectrum

if TYPE_CHECKING:
    from drivers.analysis import Analysis, Plant
    from drivers.film import Footage

AXES = "XYZ"


@dataclass(frozen=True)
class Series:
    """Histories of one unit, a column each."""

    names: tuple[str, ...]
    unit: str
    values: np.ndarray
    """(nt, n), nan where nothing is known."""
    about: str
    """What they are, with their sign."""


@dataclass(frozen=True)
class Plate:
    """The mesh as other programs read it, and what moved on it."""

    points: np.ndarray
    """(n_nodes, 3) m."""
    cells: np.ndarray
    """(n_cells, nodes a cell), in the order of VTK."""
    cell_type: str
    """meshio's name, such as "quad9"."""
    peak: np.ndarray
    """(1 or 0, n_nodes, 3) m: the displacement when a probe is farthest from zero, where it was kept."""
    rows: np.ndarray
    """(n_frames,) archived instants that were filmed."""
    film: np.ndarray
    """(n_frames, n_nodes, 3) m, in single precision."""
    envelope: np.ndarray
    """(2 or 0, n_nodes, 3) m: least and largest displacement of each component over `watched` instants."""
    watched: int
    frequency: float = 0.0
    """Hz, of `amplitude`."""
    amplitude: np.ndarray | None = None
    """(n_nodes, 3) m, complex: one-sided amplitudes at the frequency that moves a probe most, where a sweep gave them."""

    @property
    def corners(self) -> np.ndarray:
        """The corner nodes of each cell (n_cells, 3 or 4), around the cell."""
        return self.cells[:, : 3 if self.cell_type.startswith("triangle") else 4]


@dataclass(frozen=True)
class Results:
    """All that is kept of a run."""

    facts: dict[str, Any]
    """The summary: method, dofs, versions, seconds by phase, extremes, warnings."""
    scene_text: str
    """The scene file."""
    times: np.ndarray
    """(nt,) s, archived."""
    series: dict[str, Series]
    """By path, such as "contacts/force"."""
    points: dict[str, np.ndarray] = field(default_factory=dict)
    """Positions (n, 3) m: "probes" (a row for each probe), "contacts", "springs", and "directions", in which the contacts push."""
    probe_names: tuple[str, ...] = ()
    plate: Plate | None = None
    spectra: ResponseSpectrum | None = None
    spectra_names: tuple[str, ...] = ()

    @property
    def step(self) -> float:
        """Time between archived instants in s."""
        return float(self.times[-1] - self.times[0]) / max(len(self.times) - 1, 1)

    @property
    def name(self) -> str:
        """Title, method and treatment of uplift in one line."""
        passes = self.facts.get("iterations")
        how = "uplift exact" if self.facts.get("uplift") == "exact" else f"{passes} published pass{'' if passes == 1 else 'es'}"
        return f"{self.facts.get('title') or 'Uplift'} ({self.facts.get('method')}, {how})"

    def with_spectra(self, damping: tuple[float, ...]) -> Results:
        """Return the same results with floor response spectra for other damping ratios."""
        spectra = floor_spectra(self.times, self.series, damping)
        names = self.series["probes/acceleration"].names if spectra is not None else ()
        return replace(self, spectra=spectra, spectra_names=names)


def in_space(points: Any) -> np.ndarray:
    """Return points or vectors (n, 2 or 3) as (n, 3)."""
    given = np.asarray(points, dtype=float)
    given = given.reshape(len(given), -1) if given.size else np.zeros((0, 3))
    return np.column_stack([given, np.zeros((len(given), 3 - given.shape[1]))])


def floor_acceleration(series: dict[str, Series]) -> tuple[tuple[str, ...], np.ndarray]:
    """Return the names and the absolute accelerations (nt, n) m/s2 of the probes' translations: relative ones plus the ground's."""
    relative, base = series["probes/acceleration"], series["probes/base"]
    return relative.names, relative.values + base.values


def floor_spectra(times: np.ndarray, series: dict[str, Series], damping: tuple[float, ...] = DAMPING) -> ResponseSpectrum | None:
    """Return the response spectra at the probes, None where no accelerations are known."""
    if "probes/acceleration" not in series or len(times) < 2:
        return None
    _, absolute = floor_acceleration(series)
    return response_spectrum(absolute, float(times[-1] - times[0]) / (len(times) - 1), FREQUENCIES, damping)


def collect(plant: Plant, analysis: Analysis, footage: Footage | None, facts: dict[str, Any], scene_text: str) -> Results:
    """Return the results of a run, on rank 0."""
    model, operators, history = plant.assembled.model, plant.operators, analysis.final
    series = _motion(plant, analysis)
    unilateral = [support for support in model.supports if support.unilateral]
    if operators.contacts.names:
        series |= _contacts(plant, analysis)
    if operators.reactions is not None and history.reactions.shape[1]:
        series |= _reactions(operators.reactions.functionals.names, history.reactions)
    lifted = footage.lifted if footage is not None and footage.watched else analysis.lifted
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
        "probes": in_space([probe.point for probe in model.probes]),
        "contacts": in_space(operators.contacts.points),
        "springs": in_space([p for spring in model.springs for p in spring.points]),
        "bonded": in_space([p for support in model.supports if not support.unilateral for p in support.points]),
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
        plate=_plate(footage) if footage is not None else None,
        spectra=spectra,
        spectra_names=series["probes/acceleration"].names if spectra is not None else (),
    )


def _direction(unilateral: str) -> np.ndarray:
    return (-1.0 if unilateral.startswith("-") else 1.0) * np.eye(3)[AXES.index(unilateral[-1])]


def _motion(plant: Plant, analysis: Analysis) -> dict[str, Series]:
    history, names = analysis.final, plant.operators.probes.names
    rotations = np.array([name.split(".")[-1].startswith("DR") for name in names], dtype=bool)
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
    model = plant.assembled.model
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


def _contacts(plant: Plant, analysis: Analysis) -> dict[str, Series]:
    contacts, history = plant.operators.contacts, analysis.final
    tension = contacts.law.tension(history.elongation)
    force, gap = contacts.law.compression(tension, history.release), history.openings(contacts.law)
    lifted = gap > 0
    series = {
        "contacts/force": Series(contacts.names, "N", force, "Contact forces, compression positive"),
        "contacts/gap": Series(contacts.names, "m", gap, "Openings of the contacts, 0 where closed"),
        "uplift/contacts": Series(("open contacts",), "%", 100.0 * lifted.mean(axis=1, keepdims=True), "Share of the open contacts"),
    }
    groups, first = {}, 0
    for support in plant.assembled.model.supports:
        if support.unilateral:
            groups[support.name] = np.arange(first, first + len(support.points))
            first += len(support.points)
    for line in contact_lines(groups, np.asarray(contacts.points)):
        names = tuple(contacts.names[i] for i in line.contacts)
        about = f"Contact force of {line.name} over the length of line that belongs to each contact, half the way to its neighbours"
        series[f"contacts/line force/{line.name.replace('/', '_')}"] = Series(names, "N/m", line.pressure(force), about)
    return series


def _reactions(names: tuple[str, ...], values: np.ndarray) -> dict[str, Series]:
    moments = np.array(["moment" in name for name in names], dtype=bool)
    parts = (("reactions/force", ~moments, "N", "Resultants of the ground's forces on the plate"),
             ("reactions/moment", moments, "N m", "Their moments about the middle of the plate's foot"))
    return {
        path: Series(tuple(name for name, wanted in zip(names, mask, strict=True) if wanted), unit, values[:, mask], about)
        for path, mask, unit, about in parts
        if mask.any()
    }


def _plate(footage: Footage) -> Plate:
    mesh = footage.mesh
    return Plate(
        mesh.points, mesh.cells, mesh.cell_type, footage.peak, footage.rows, footage.displacement,
        footage.envelope, footage.watched, footage.frequency, footage.amplitude,
    )
