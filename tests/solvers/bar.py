"""An elastic bar that flies against a stop, with the closed form of its impact by travelling waves."""

import numpy as np
from scipy.optimize import brentq

from uplift.forms.contact.law import UpliftLaw
from uplift.solvers.time_domain.exact.model import DenseModel
from uplift.solvers.time_domain.exact.starts import Start

LENGTH, WAVE_SPEED, IMPEDANCE, SPEED = 3.0, 1500.0, 6.0e4, 0.8
"""m, m/s, N s/m (density times wave speed times area), m/s."""
RISE = 0.05
"""Impedance over the stop's stiffness, as a part of the time that a wave needs to the free end and back."""


def bar_on_a_stop(cells):
    """The bar of `cells` elements and its start at the stop, moving towards it; outputs are the mean velocity's integral and the tip."""
    size = LENGTH / cells
    there_and_back = 2 * LENGTH / WAVE_SPEED
    stop = IMPEDANCE / (RISE * there_and_back)
    n = cells + 1
    stiffness, consistent, lumped = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    density = IMPEDANCE / WAVE_SPEED
    for e in range(cells):
        rows = np.ix_([e, e + 1], [e, e + 1])
        stiffness[rows] += IMPEDANCE * WAVE_SPEED / size * np.array([[1, -1], [-1, 1]])
        consistent[rows] += density * size / 6 * np.array([[2, 1], [1, 2]])
        lumped[rows] += density * size / 2 * np.eye(2)
    spring = np.zeros((n, n))
    spring[0, 0] = stop
    end = np.eye(n)[:1]
    # The mean of the two masses has a dispersion of fourth order.
    mass = 0.5 * (consistent + lumped)
    model = DenseModel(
        mass=mass, damping=np.zeros((n, n)), stiffness=stiffness + spring, loads=np.zeros((n, 0)), histories=(), static=(), internal=(),
        push=end.T, elongation=end, law=UpliftLaw(np.array([stop]), np.array([1 / stop])), names=("stop",),
        outputs=np.vstack([mass.sum(axis=0) / mass.sum(), end]), output_release=np.zeros((2, 1)), output_constant=np.zeros(2),
        output_names=("mean", "tip"), output_units=("m", "m"), springs=np.zeros((n, n)), unilateral=spring,
    )
    return model, Start(np.zeros(n), np.full(n, -SPEED), np.zeros(1))


def contact_time():
    """Time in s after which the force is zero again.

    With F the force, Z the impedance and s the time over Z / k: F = Z v (1 - exp(-s)) until the wave is back from the free end, then
    F' + F = Z v (2 exp(-s) - 1), s counted anew, so that F = Z v ((2 s + C) exp(-s) - 1).
    """
    there_and_back = 2 * LENGTH / WAVE_SPEED
    start = 2 - np.exp(-1 / RISE)
    return there_and_back * (1 + RISE * brentq(lambda s: (2 * s + start) * np.exp(-s) - 1, 0.1, 10.0))


def rebound_speed():
    """Mean velocity in m/s after the contact: the impulse of the force of `contact_time` over the mass, less the first velocity."""
    there_and_back = 2 * LENGTH / WAVE_SPEED
    start = 2 - np.exp(-1 / RISE)
    s = (contact_time() / there_and_back - 1) / RISE
    first = 1 - RISE * (1 - np.exp(-1 / RISE))
    second = RISE * (2 * (1 - (1 + s) * np.exp(-s)) + start * (1 - np.exp(-s)) - s)
    return IMPEDANCE * SPEED * there_and_back * (first + second) / (IMPEDANCE / WAVE_SPEED * LENGTH) - SPEED
