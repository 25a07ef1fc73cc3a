"""A mass that bounces on a unilateral spring under gravity, with a closed form."""

import numpy as np

from tests.small import contact_on, dense_operators
from uplift.forms.loads.signals import Constant

MASS, STIFFNESS, GRAVITY = 2.0, 800.0, 9.81
START_VELOCITY = 1.7


def operators():
    """The mass bonded to its spring; the contact's elongation is the displacement, upwards positive."""
    loads = [(np.array([-MASS * GRAVITY]), Constant(1.0), True)]
    return dense_operators([[STIFFNESS]], [[MASS]], None, loads, contacts=contact_on(0, STIFFNESS, 1))


def height(times):
    """Displacement (nt,) m from the static position with START_VELOCITY upwards: harmonic in contact, ballistic in flight."""
    omega, sag = np.sqrt(STIFFNESS / MASS), MASS * GRAVITY / STIFFNESS
    amplitude = START_VELOCITY / omega
    leave = np.arcsin(sag / amplitude) / omega
    up = START_VELOCITY * np.cos(omega * leave)
    flight = 2 * up / GRAVITY
    in_contact = (np.pi + 2 * np.arcsin(sag / amplitude)) / omega
    period = flight + in_contact
    phase = np.mod(np.asarray(times) - leave, period)
    # A cycle begins at lift-off; after the flight the mass comes down at the angle pi - that of lift-off.
    angle = np.pi - omega * leave + omega * (phase - flight)
    return np.where(phase < flight, up * phase - 0.5 * GRAVITY * phase**2, amplitude * np.sin(angle) - sag)
