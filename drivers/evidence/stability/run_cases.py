"""Cases of the run: its steps, the size of its signal, its state of rest."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from uplift.drivers.evidence.stability import laws
from uplift.drivers.evidence.stability.cases import Case, dense
from uplift.drivers.evidence.stability.laws import SUDDEN


def steps() -> list[Case]:
    """Return the cases of time steps."""
    cases = [
        Case(
            "Time step",
            f"dt = {dt:g} s",
            "500 steps of a pulse that sets in suddenly at time 0, against the independent model on the same steps; "
            "relative to the motion itself, however small",
            dense(SUDDEN | {"transient.step": dt, "transient.duration": 500 * dt}),
            quick=dt in (1e-6, 1.0),
        )
        for dt in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0)
    ]
    cases.append(
        Case(
            "Time step",
            "100,000 steps",
            "free undamped vibration: average acceleration turns each mode by the angle 2 atan(omega dt / 2) a step, "
            "so that the end is known in closed form, from the eigenvectors of the independent model",
            laws.drift,
            1e-8,
            "eps x largest angle turned, 3e5 rad, x 100",
        )
    )
    return cases


def amplitudes() -> list[Case]:
    """Return the cases of amplitudes and of gravity."""
    return [
        Case(
            "Amplitude and gravity",
            "amplitude 0",
            "nothing may move in 1,000 steps: largest displacement from the static state, relative to it",
            laws.still,
            1e-12,
            "1,000 steps x eps x 5",
        ),
        Case(
            "Amplitude and gravity",
            "amplitude 1e-12 m/s2",
            "the motion, 11 digits below the static state, against the independent model",
            lambda bench: bench.moved_against_dense({"load.amplitude": 1e-12}),
            origin="eps x condition of the stiffness x static displacement / motion",
        ),
        Case(
            "Amplitude and gravity",
            "amplitude 1e3 m/s2",
            "the plate is thrown about by 100 g; against the independent model",
            dense({"load.amplitude": 1e3}),
        ),
        *(
            Case(
                "Amplitude and gravity",
                f"amplitude {a:g} m/s2, no gravity",
                "without weight everything is proportional to the amplitude, uplift "
                "included: displacements and contact forces over the amplitude against those of 1 m/s2",
                partial(laws.homogeneous, amplitude=a),
                1e-10,
                "round-off",
            )
            for a in (1e-12, 1e3)
        ),
        Case("Amplitude and gravity", "no gravity", "against the independent model", dense({"gravity": None})),
        Case(
            "Amplitude and gravity",
            "gravity reversed",
            "the plate hangs on the two top springs of 1 N/m, 392 km up, every contact open: static state against the independent model",
            lambda bench: replace(bench.static_against_dense({"gravity.acceleration": -9.81}), limit=None),
            1e-6,
            "10 x eps x stiffness with contacts closed over that with them open, 5e8 / 2",
        ),
    ]


def static_cases() -> list[Case]:
    """Return the cases that concern the state before the ground moves."""
    return [
        Case(
            "Start",
            "gap of 5 mm, ten settling steps",
            "the plate has to fall 5 mm before it touches, and ten long steps do not bring it to rest: the "
            "run must warn, and start = 'static' must give the independent model's answer",
            laws.gap,
        ),
    ]
