"""Uplift from one sweep and no iteration: convolution quadrature at the Laplace points of a time scheme, and a march.

A time scheme with constant steps is a rational function of the shift z = exp(-s dt): written for the generating function
U(z) = sum_n u_n z^n, the recurrences for displacement, velocity and acceleration give

    (K + d1(z) C + m(z) d2(z) M) U(z) = F(z),
    d2 = (1 - z)^2 / (dt^2 p),  d1 = (1 - z) (gamma + (1 - gamma) z) / (dt p),
    p = beta + (1/2 + gamma - 2 beta) z + (1/2 - gamma + beta) z^2,
    m = (1 - alpha_m + alpha_m z) / (1 - alpha_f + alpha_f z),

for the trapezoidal rule d1 = 2 (1 - z) / (dt (1 + z)), d2 = d1^2. Solved at the points z_k = rho exp(-2 pi i k / L) of a circle, by
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
from uplift.solvers.contact.auxiliary_nodes import FreeNodes
from uplift.solvers.contact.step import ContactProblem
from uplift.solvers.frequency_domain.convolution import OnlineConvolution
from uplift.solvers.frequency_domain.sweep import Transfer, sweep
from uplift.solvers.history import History
from uplift.solvers.spectra import second_differences
from uplift.solvers.time_domain.initial import balance_acceleration
from uplift.solvers.time_domain.scheme import Scheme
from uplift.solvers.time_domain.state import State, load_scale, load_values, tensions


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

    def _denominator(self) -> np.ndarray:
        beta, gamma, z = self.scheme.beta, self.scheme.gamma, self.points
        return beta + (0.5 + gamma - 2 * beta) * z + (0.5 - gamma + beta) * z**2

    @property
    def first(self) -> np.ndarray:
        """d1 (L/2 + 1,) in 1/s."""
        gamma, z = self.scheme.gamma, self.points
        return (1 - z) * (gamma + (1 - gamma) * z) / (self.step * self._denominator())

    @property
    def second(self) -> np.ndarray:
        """M d2 (L/2 + 1,) in 1/s2."""
        return self._inertia_weight() * (1 - self.points) ** 2 / (self.step**2 * self._denominator())

    def _inertia_weight(self) -> np.ndarray:
        s, z = self.scheme, self.points
        return (1 - s.alpha_m + s.alpha_m * z) / (1 - s.alpha_f + s.alpha_f * z)

    def of_initial_load(self) -> np.ndarray:
        """Return what multiplies the load f0 at time 0 beside its own transform, (L/2 + 1,)."""
        s, z = self.scheme, self.points
        shift = (s.alpha_f - s.alpha_m) / (1 - s.alpha_f + s.alpha_f * z)
        return shift - self._inertia_weight() * (s.beta * (1 - z) + s.gamma * z) / self._denominator()

    def of_initial_damping(self) -> np.ndarray:
        """Return what multiplies C a0, with a0 the acceleration at time 0, (L/2 + 1,) in s."""
        s, z = self.scheme, self.points
        slope = (s.beta * (1 - z) + s.gamma * z) / self._denominator()
        return self.step * (s.gamma / (1 - z) - (s.gamma + (1 - s.gamma) * z) / (1 - z) * slope)

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
    operators: Operators,
    scheme: Scheme,
    step: float,
    steps: int,
    start: State,
    *,
    every: int = 1,
    exact_uplift: bool = True,
    solve: Callable[..., Transfer] = sweep,
    **how: Any,
) -> LaplaceRun:
    """Sweep and march `steps` steps of `step` s from the state of rest `start` (collective).

    Every `every`-th step is archived. Without `exact_uplift` every contact stays bonded. `start` must be the static answer
    to the static loads, or zero with all of them set upon it at time 0; its velocity is taken as zero. `solve` makes the sweep, called
    as `frequency_domain.sweep.sweep` is: the direct one, or one in a basis; `how` holds further
    arguments of it, such as `groups` and `watch`.
    """
    circle = Circle(scheme, step, steps)
    times = step * np.arange(steps + 1)
    values = load_values(operators, times)
    if start.displacement.norm() > 0:
        values = values - load_values(operators, np.zeros(1), static_only=True)
    n_loads, n_channels = len(operators.loads), operators.contacts.law.n_channels

    more = []
    sudden = bool(np.any(values[0] != 0))
    if sudden:
        more.append(_initial_damping(operators, start, values[0], step))
    begin = time.perf_counter()
    transfer = solve(operators, circle.first, circle.second, more=tuple(more), prefix="laplace_", what="Laplace sweep", **how)
    for vector in more:
        vector.destroy()

    sweep_seconds = time.perf_counter() - begin
    begin = time.perf_counter()
    drive = np.zeros((len(circle.points), transfer.probes.shape[2]), dtype=complex)
    drive[:, :n_loads] = circle.forward(values)
    if sudden:
        drive[:, :n_loads] += circle.of_initial_load()[:, None] * values[0]
        drive[:, -1] = circle.of_initial_damping()
    release = np.tile(start.release, (steps + 1, 1))
    tries, motions = 0.0, None
    if exact_uplift and n_channels:
        release, motions, tries = _march(operators, circle, transfer, drive, start)
        drive[:, n_loads : n_loads + n_channels] = circle.forward(release - start.release)
    rest, response = np.real(start.displacement.array_r).copy(), transfer.response(drive)

    def field(row: int) -> np.ndarray | None:
        return None if response is None else rest + response.at(_weights(circle, row * every))

    history = _history(operators, circle, transfer, drive, start, release, motions, every)
    history = replace(history, peak_field=field(history.peak))
    seconds = time.perf_counter() - begin
    return LaplaceRun(history, len(circle.points), transfer.factor_seconds, sweep_seconds, seconds, tries, field)


def _initial_damping(operators: Operators, start: State, values: np.ndarray, step: float) -> Any:
    """Return the vector C a0 with M a0 the load at time 0 (PETSc vector in N s)."""
    with start.copy() as state:
        state.displacement.zeroEntries()
        state.velocity.zeroEntries()
        state.release = np.zeros_like(state.release)
        balance_acceleration(operators, state, values, step)
        vector = operators.new_vector()
        if operators.damping is not None:
            operators.damping.mult(state.acceleration, vector)
    return vector


def _march(
    operators: Operators, circle: Circle, transfer: Transfer, drive: np.ndarray, start: State
) -> tuple[np.ndarray, np.ndarray | None, float]:
    """Return the release forces (steps + 1, n_channels) N, the motion of nodes with mass, and the contact problems tried per step."""
    law = operators.contacts.law
    n_loads, n_channels = len(operators.loads), law.n_channels
    linear = law.tension(circle.inverse(np.einsum("fcj,fj->fc", transfer.elongation, drive))) + tensions(operators, start.displacement)
    kernel = law.stiffness[:, None] * circle.inverse(transfer.elongation[:, :, n_loads : n_loads + n_channels])
    problem = ContactProblem(law, kernel[0])
    release = np.tile(start.release, (circle.steps + 1, 1))
    scale = load_scale(operators, load_values(operators, circle.step * np.arange(circle.steps + 1)))
    nodes = FreeNodes(law, circle.step)
    motions = np.repeat(nodes.still(start.release)[:, None], circle.steps + 1, axis=1) if nodes.any else None

    def step(n: int, past: np.ndarray) -> np.ndarray:
        if n > 0:
            tension = linear[n] + past - kernel[0] @ start.release
            if motions is None:
                release[n] = problem.solve(tension, release[n - 1], scale)
            else:
                release[n], motions[:, n] = nodes.solve(problem, tension, release[n - 1], motions[:, n - 1], scale)
        return release[n] - start.release

    OnlineConvolution(kernel).run(step)
    return release, motions, problem.tries / max(problem.solved, 1)


def _history(
    operators: Operators,
    circle: Circle,
    transfer: Transfer,
    drive: np.ndarray,
    start: State,
    release: np.ndarray,
    motions: np.ndarray | None,
    every: int,
) -> History:
    here = np.real(start.displacement.array_r)
    observed = [operators.probes, operators.contacts.elongation]
    parts = [transfer.probes, transfer.elongation]
    if operators.reactions is not None:
        observed.append(operators.reactions.functionals)
        parts.append(transfer.resultants)
    whole = [
        functionals.total(functionals.partial(here)) + circle.inverse(np.einsum("foj,fj->fo", part, drive))
        for functionals, part in zip(observed, parts, strict=True)
    ]
    felt = second_differences(whole[0], circle.step)[::every]
    values = [part[::every] for part in whole]
    archived = release[::every]
    probes, elongation = values[:2]
    standing, gap = archived, None
    if motions is not None:
        nodes = FreeNodes(operators.contacts.law, circle.step)
        standing, gap = nodes.on_ground(archived, motions[:, ::every]), nodes.gap(motions[:, ::every])
    reactions = operators.reactions.values(values[2], standing) if operators.reactions is not None else np.zeros((len(archived), 0))
    peak = int(np.argmax(np.max(np.abs(probes), axis=1))) if probes.size else 0
    times = circle.step * np.arange(0, circle.steps + 1, every)
    return History(times, probes, elongation, archived, reactions, peak, accelerations=felt, gap=gap)


def _weights(circle: Circle, n: int) -> np.ndarray:
    """Return the weights (n_points,) of the inverse transform at step `n`."""
    k = np.arange(len(circle.points))
    weight = np.where((k == 0) | (2 * k == circle.length), 1.0, 2.0) / circle.length / circle.radius**n
    weights: np.ndarray = weight * np.exp(2j * np.pi * (k * n % circle.length) / circle.length)
    return weights
