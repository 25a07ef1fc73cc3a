"""Uplift from one sweep and no iteration: convolution quadrature at the Laplace points of a time scheme, and a march.

A time scheme with constant steps is a rational function of the shift z (`uplift.solvers.time_domain.scheme`).
Solved at the points z_k = rho exp(-2 pi i k / L) of a circle, by
FFTs scaled with rho^-n this yields the very histories of the time scheme: the bonded response and the causal compliance kernel
h_n of the contacts. The march over the release forces then closes the small contact problem with h_0 at each step. The points
are independent of one another, so this is the variant that spreads over many machines.

The circle wraps with an error of rho^L, and its scaling enlarges round-off to eps rho^-N; rho^L = eps^(2/3) with L = 2 N makes them equal.
All histories are deviations from the state at time 0, which is at rest.

Sources: Lubich, Numer. Math. 52 (1988) 129 and 413; Banjai and Sauter, SIAM J. Numer. Anal. 47 (2008) 227.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.fft

from uplift.forms.operators import Operators
from uplift.solvers.contact.laws import contact_step
from uplift.solvers.contact.memory import ContactMemory, ContactStep, closed
from uplift.solvers.frequency_domain.convolution import OnlineConvolution
from uplift.solvers.frequency_domain.sweep import sweep
from uplift.solvers.frequency_domain.transfer import Transfer
from uplift.solvers.history import History, farthest
from uplift.solvers.spectra import second_differences
from uplift.solvers.time_domain.balance import balance_acceleration
from uplift.solvers.time_domain.scheme import Scheme, Symbol
from uplift.solvers.time_domain.state import Drive, State, load_values, tensions


@dataclass(frozen=True)
class Circle:
    """The points of the z-plane that a run of `steps` steps of `step` s needs."""

    scheme: Scheme
    step: float
    steps: int

    @property
    def length(self) -> int:
        """Number of points L on the whole circle, even."""
        return 2 * int(scipy.fft.next_fast_len(self.steps + 1, real=True))

    @property
    def radius(self) -> float:
        """Radius rho."""
        return float(np.finfo(float).eps ** (2 / (3 * self.length)))

    @property
    def points(self) -> np.ndarray:
        """The points (L/2 + 1,) of the half circle; the others are their conjugates."""
        return self.radius * np.exp(-2j * np.pi * np.arange(self.length // 2 + 1) / self.length)

    @property
    def symbol(self) -> Symbol:
        """The scheme at the points."""
        return self.scheme.symbol(self.points, self.step)

    def forward(self, values: np.ndarray) -> np.ndarray:
        """Return the transform sum_n values_n z^n (L/2 + 1, ...) of values (steps + 1, ...)."""
        scale = (self.radius ** np.arange(len(values))).reshape(-1, *[1] * (values.ndim - 1))
        return scipy.fft.rfft(scale * values, self.length, axis=0)

    def inverse(self, transform: np.ndarray) -> np.ndarray:
        """Return the values (steps + 1, ...) of a transform (L/2 + 1, ...)."""
        values = scipy.fft.irfft(transform, self.length, axis=0)[: self.steps + 1]
        return values / (self.radius ** np.arange(self.steps + 1)).reshape(-1, *[1] * (values.ndim - 1))


@dataclass(frozen=True)
class LaplaceRun:
    """A history and what it cost."""

    history: History
    points: int
    factor_seconds: float
    sweep_seconds: float
    """Of the whole sweep, factorisations, solves, checks and observation."""
    march_seconds: float
    tries: float
    """Contact problems tried per step."""
    field: Callable[[int], np.ndarray | None]
    """Gives this rank's part (n_local,) of the displacements at an archived instant, None where fields were not kept."""


def laplace_run(
    operators: Operators, scheme: Scheme, step: float, steps: int, start: State, *, every: int = 1, exact_uplift: bool = True,
    at_zero: bool = False, **how: Any
) -> LaplaceRun:
    """Sweep and march `steps` steps of `step` s from the state of rest `start` (collective).

    Every `every`-th step is archived. Without `exact_uplift` every contact stays bonded. `start` must be the static answer
    to the static loads, or with `at_zero` the plate at zero, its joints in equilibrium and all other loads set upon it at time 0; its
    velocity is taken as zero. `how` holds further arguments of
    the sweep, such as `groups` and `watch`.
    Many parameters because a march needs all of them.
    """
    circle = Circle(scheme, step, steps)
    symbol = circle.symbol
    drive = Drive.of(operators, step * np.arange(steps + 1))
    values = drive.values
    balanced = load_values(operators, np.zeros(1), static_only=True)
    if at_zero:
        balanced = balanced * np.array([load.internal for load in operators.loads], dtype=float)
    if start.displacement.norm() > 0:
        values = values - balanced
    n_loads, n_channels = len(operators.loads), operators.contacts.law.n_channels
    more, moved = [], None
    sudden = bool(np.any(values[0] != 0))
    if sudden:
        damping, moved = _initial_damping(operators, start, values[0], step)
        more.append(damping)
    begin = time.perf_counter()
    transfer = sweep(operators, symbol.s, symbol.s_squared, more=tuple(more), prefix="laplace_", what="Laplace sweep", **how)
    for vector in more:
        vector.destroy()
    sweep_seconds = time.perf_counter() - begin
    begin = time.perf_counter()
    amplitudes = np.zeros((len(circle.points), transfer.outputs.shape[2]), dtype=complex)
    amplitudes[:, :n_loads] = circle.forward(values)
    if sudden:
        amplitudes[:, :n_loads] += symbol.initial_load[:, None] * values[0]
        amplitudes[:, -1] = symbol.initial_damping
    contact = _Contact.bonded(start, steps)
    if exact_uplift and n_channels:
        contact = _march(operators, circle, transfer, amplitudes, start, drive.scale)
        amplitudes[:, n_loads : n_loads + n_channels] = circle.forward(contact.release - start.release)
    rest, response = np.real(start.displacement.array_r).copy(), transfer.response(amplitudes)

    def field(row: int) -> np.ndarray | None:
        return None if response is None else operators.reconstruct(rest + response.at(_weights(circle, row * every)))

    spectra = np.einsum("foj,fj->fo", transfer.outputs, amplitudes)
    if moved is not None:  # the velocity of a sudden start is s times the displacement less this
        spectra -= symbol.initial_damping[:, None] * moved
    history = _history(operators, circle, spectra, rest, contact, drive.values[::every])
    history = replace(history, peak_field=field(history.peak))
    seconds = time.perf_counter() - begin
    return LaplaceRun(history, len(circle.points), transfer.factor_seconds, sweep_seconds, seconds, contact.tries, field)


def _initial_damping(operators: Operators, start: State, values: np.ndarray, step: float) -> tuple[Any, np.ndarray | None]:
    """Return the vector C a0 with M a0 the load at time 0 (PETSc vector in N/s) and the outputs (n_rows,) of a velocity a0, if any."""
    with start.copy() as state:
        state.displacement.zeroEntries()
        state.velocity.zeroEntries()
        state.contacts = closed(len(state.release))
        balance_acceleration(operators, state, values, step)
        vector = operators.new_vector()
        if operators.damping is not None:
            operators.damping.mult(state.acceleration, vector)
        moved = operators.outputs.velocity_rows(np.real(state.acceleration.array_r))
    return vector, moved


@dataclass(frozen=True)
class _Contact:
    """The contacts at every step of a march."""

    law: ContactStep | None
    release: np.ndarray
    """(steps + 1, n_channels) N."""
    inner: np.ndarray
    """(steps + 1, n_inner)."""

    @staticmethod
    def bonded(start: State, steps: int) -> _Contact:
        return _Contact(None, np.tile(start.release, (steps + 1, 1)), np.zeros((steps + 1, 0)))

    @property
    def tries(self) -> float:
        return self.law.tries if self.law is not None else 0.0


def _march(
    operators: Operators, circle: Circle, transfer: Transfer, amplitudes: np.ndarray, start: State, scale: float
) -> _Contact:
    """Close the small contact problem at each step; `scale` as in `Drive`."""
    law, answers = operators.contacts.law, transfer.elongation
    n_loads = len(operators.loads)
    linear = law.tension(circle.inverse(np.einsum("fcj,fj->fc", answers, amplitudes))) + tensions(operators, start.displacement)
    kernel = law.stiffness[:, None] * circle.inverse(answers[:, :, n_loads : n_loads + law.n_channels])
    contacts = contact_step(law, kernel[0], circle.step)
    memory = contacts.begin(ContactMemory(start.release, np.zeros(0)))
    memories = [memory] * (circle.steps + 1)

    def step(n: int, past: np.ndarray) -> np.ndarray:
        if n > 0:
            tension = linear[n] + past - kernel[0] @ start.release
            memories[n] = contacts.advance(tension, memories[n - 1], scale)
        return memories[n].release - start.release

    OnlineConvolution(kernel).run(step)
    return _Contact(contacts, np.array([m.release for m in memories]), np.array([m.inner for m in memories]))


def _history(
    operators: Operators, circle: Circle, spectra: np.ndarray, rest: np.ndarray, contact: _Contact, loads: np.ndarray
) -> History:
    """Return the archived outputs from their transforms (n_points, n_rows); `rest` (n_local,) m is the state of rest.

    `loads` (nt, n_loads) are the load histories at the archived instants.
    """
    layout, every = operators.outputs, circle.steps // (len(loads) - 1)
    linear = layout.total(layout.partial(rest)) + circle.inverse(spectra)
    second = second_differences(linear[:, layout.accelerated], circle.step)[::every]
    release, inner = contact.release[::every], contact.inner[::every]
    force, gap = (release, None) if contact.law is None else (contact.law.support_force(release, inner), contact.law.openings(inner))
    outputs = layout.values(linear[::every], force, loads, second)
    peak = int(np.argmax(farthest(outputs[:, layout.layout["probes"]], operators.probes.moving)))
    times = circle.step * np.arange(0, circle.steps + 1, every)
    return History(times, outputs, layout, release, peak, accelerations=second[:, : len(operators.probes.names)], gap=gap)


def _weights(circle: Circle, n: int) -> np.ndarray:
    """Return the weights (n_points,) of the inverse transform at step `n`."""
    k = np.arange(len(circle.points))
    weight = np.where((k == 0) | (2 * k == circle.length), 1.0, 2.0) / circle.length / circle.radius**n
    weights: np.ndarray = weight * np.exp(2j * np.pi * (k * n % circle.length) / circle.length)
    return weights
