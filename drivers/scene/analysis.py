"""How a scene is analysed: parameters of the methods and of the output."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uplift.meshes.checked import Checked, ModelError, quantity
from uplift.meshes.groups import GroupNames
from uplift.solvers.time_domain.scheme import Scheme, generalised_alpha, hilber_hughes_taylor

METHODS = ("transient", "exact", "time-frequency", "modal", "static", "harmonic")


@dataclass(frozen=True)
class Settling(Checked):
    """Over-damped steps before time 0 that bring the model to rest under its static loads."""

    step: float = quantity("length of a step", "s", default=1.0, above=0.0)
    steps: int = quantity("number of steps", default=10, at_least=1, at_most=1_000_000)
    beta: float = quantity("Newmark's beta", default=1.0)
    gamma: float = quantity("Newmark's gamma", default=1.5)

    def check(self) -> None:
        """Refuse an inadmissible scheme."""
        Scheme(self.beta, self.gamma)


@dataclass(frozen=True)
class Transient(Checked):
    """Time stepping by Newmark's method."""

    step: float = quantity("time step", "s", above=0.0)
    duration: float = quantity("end of the analysis", "s", above=0.0)
    every: int = quantity("archive every so many steps", default=1, at_least=1, at_most=10_000_000)
    method: str = quantity(
        "time integration", default="newmark", one_of=("newmark", "hht", "generalised-alpha")
    )
    beta: float = quantity("Newmark's beta", default=0.25)
    gamma: float = quantity("Newmark's gamma", default=0.5)
    alpha: float = quantity("dissipation of the method hht", default=0.05, at_least=0.0, at_most=1 / 3)
    rho_infinity: float = quantity(
        "spectral radius at high frequency of generalised-alpha; 1: no dissipation", default=0.8, at_least=0.0, at_most=1.0
    )
    start: str = quantity("state at time 0", default="static", one_of=("static", "settled", "rest"))
    settling: Settling = quantity("steps before time 0 for start = 'settled'", factory=Settling)

    def check(self) -> None:
        """Refuse an inadmissible scheme and an archive that does not end with the last step."""
        if self.method != "newmark" and (self.beta, self.gamma) != (0.25, 0.5):
            raise ModelError("beta", f"beta and gamma belong to the method newmark; {self.method} sets its own")
        Scheme(self.beta, self.gamma)
        if self.duration / self.step > 1e8:
            raise ModelError("step", f"expected at most 1e8 steps, got {self.duration / self.step:.3g}")
        if abs(self.steps * self.step - self.duration) > 1e-9 * self.duration:
            raise ModelError("duration", f"expected a multiple of the step {self.step:g} s, got {self.duration:g} s")
        if self.steps % self.every:
            raise ModelError("every", f"expected a divisor of the {self.steps} steps, got {self.every}")

    @property
    def steps(self) -> int:
        """Number of steps."""
        return round(self.duration / self.step)

    @property
    def scheme(self) -> Scheme:
        """Parameters of the scheme."""
        if self.method == "hht":
            return hilber_hughes_taylor(self.alpha)
        if self.method == "generalised-alpha":
            return generalised_alpha(self.rho_infinity)
        return Scheme(self.beta, self.gamma)

    @property
    def archived(self) -> np.ndarray:
        """Archived instants (n_archived,) s."""
        return self.step * np.arange(0, self.steps + 1, self.every)


@dataclass(frozen=True)
class Modal(Checked):
    """The basis of the modal method."""

    number: int | None = quantity("number of the lowest modes", default=None, at_least=1, at_most=1_000_000)
    low: float | None = quantity("lower end of the band of frequencies, instead of a number", "Hz", default=None, at_least=0.0)
    high: float | None = quantity("upper end of the band", "Hz", default=None, above=0.0)
    shift: float = quantity("where the search begins; below zero for a structure that can move without strain", "rad2/s2",
                            default=0.0, at_most=0.0)
    diagonal: bool = quantity("keep only the diagonals of the projected matrices", default=False)
    static_correction: bool = quantity("add the static answers to the loads and to unit contact forces", default=True)

    def check(self) -> None:
        """Either a number or a band."""
        if (self.number is None) == (self.high is None):
            raise ModelError("number", "expected either a number of modes or a band from low to high")
        if self.high is not None and not (self.low or 0.0) < self.high:
            raise ModelError("high", f"expected > low = {self.low:g} Hz, got {self.high:g} Hz")

    @property
    def band(self) -> tuple[float, float] | None:
        """The band (low, high) in Hz, or None."""
        return None if self.high is None else (self.low or 0.0, self.high)


@dataclass(frozen=True)
class Harmonic(Checked):
    """The frequencies of a harmonic analysis."""

    frequencies: tuple[float, ...] = quantity("frequencies", "Hz", default=())
    low: float | None = quantity("lowest of equidistant frequencies, instead of a list", "Hz", default=None, at_least=0.0)
    high: float | None = quantity("highest of them", "Hz", default=None, above=0.0)
    count: int = quantity("how many of them", default=101, at_least=2, at_most=1_000_000)

    def check(self) -> None:
        """Either a list or a range."""
        if bool(self.frequencies) == (self.high is not None):
            raise ModelError("frequencies", "expected either frequencies or low, high and count")
        if self.high is not None and not (self.low or 0.0) < self.high:
            raise ModelError("high", f"expected > low = {self.low:g} Hz, got {self.high:g} Hz")
        for value in self.frequencies:
            if not 0 <= value < float("inf"):
                raise ModelError("frequencies", f"expected >= 0 Hz, got {value!r}")

    @property
    def points(self) -> np.ndarray:
        """(n_f,) Hz."""
        return np.array(self.frequencies) if self.high is None else np.linspace(self.low or 0.0, self.high, self.count)


@dataclass(frozen=True)
class Basis(Checked):
    """The Krylov basis in which the methods transient and time-frequency run where a scene has this section."""

    tolerance: float = quantity("relative residual that it is grown to", default=1e-6, above=0.0, below=1.0)
    band: float | None = quantity("highest frequency that it is tested at; where it is not given, the cutoff of [fourier] or 25 Hz", "Hz",
                                  default=None, above=0.0)
    file: str = quantity("HDF5 file beside the scene that it is read from, or written to if it is not there yet", default="")


@dataclass(frozen=True)
class Output(Checked):
    """What is reported beside the histories."""

    instants: tuple[float, ...] = quantity("instants whose values are printed", "s", default=())
    uplift: str = quantity(
        "when the lifted share of the plate's area is recorded", default="instants", one_of=("instants", "all", "none")
    )
    uplift_group: GroupNames = quantity("group or groups of cells whose lifted share is recorded; empty: all of them", default="")
    envelopes: bool = quantity("record least and largest section forces over time all over the plate", default=False)

    def check(self) -> None:
        """Refuse instants that cannot be."""
        for instant in self.instants:
            if not 0 <= instant < float("inf"):
                raise ModelError("instants", f"expected >= 0 s, got {instant!r}")

    def uplift_rows(self, times: np.ndarray) -> np.ndarray:
        """Return which of the archived instants (nt,) the lifted share is recorded at, (nt,) bool."""
        if self.uplift == "none":
            return np.zeros(len(times), dtype=bool)
        if self.uplift == "all":
            return np.ones(len(times), dtype=bool)
        tolerance = 1e-6 * (times[1] - times[0]) if len(times) > 1 else 1e-12
        return np.any(np.abs(times[:, None] - np.asarray(self.instants)[None, :]) <= tolerance, axis=1)


@dataclass(frozen=True)
class Run(Checked):
    """How the scene is analysed where the command line does not say it."""

    method: str = quantity("method of analysis", default="transient", one_of=METHODS)
    iterations: int = quantity("published passes; 0: uplift is solved exactly", default=0, at_least=0, at_most=1_000_000)
