"""States that a march starts from: the static answer, and what some settling steps come to."""

from __future__ import annotations

import numpy as np

from uplift.forms.operators import Operators
from uplift.solvers.contact.memory import ContactMemory
from uplift.solvers.contact.step import ContactProblem, pulls, settled_release
from uplift.solvers.linear import definite_solver
from uplift.solvers.time_domain.newmark import ContactCompliance, Newmark
from uplift.solvers.time_domain.scheme import Scheme
from uplift.solvers.time_domain.state import Drive, State, at_rest, load_scale, load_values, loads_at, tensions


def static_state(operators: Operators, *, exact_uplift: bool = False, rigid_modes: np.ndarray | None = None) -> State:
    """Return the static answer to the static loads (collective); contacts bonded, or lifted where they pull.

    With the `rigid_modes` (k, n_local) it is found iteratively. Raises `SolverError` if there is none.
    """
    state = at_rest(operators)
    values = load_values(operators, np.zeros(1), static_only=True)[0]
    right = loads_at(operators, values, state.release)
    with definite_solver(operators.stiffness, "static_", "static initial state", rigid_modes) as solver:
        solver.solve(right, state.displacement, check=right.norm() > 0)
        if exact_uplift and state.release.size:
            law, scale, tension = operators.contacts.law, load_scale(operators, values[None, :]), tensions(operators, state.displacement)
            if pulls(law, tension, scale):
                compliance = ContactCompliance(operators, solver, 1.0)
                release = settled_release(ContactProblem(law, compliance.matrix), tension, scale)
                state.displacement.array[:] += release @ compliance.answers
                state.contacts = ContactMemory(release, state.contacts.inner)
    right.destroy()
    return state


def settled_state(
    operators: Operators,
    scheme: Scheme,
    step: float,
    steps: int,
    *,
    exact_uplift: bool = False,
    rigid_modes: np.ndarray | None = None,
) -> State:
    """Return the state after `steps` undamped steps under the static loads from rest, ending at time 0 (collective).

    With the `rigid_modes` (k, n_local) systems are solved iteratively. With beta = 1, gamma = 1.5 and long steps
    this is the static answer, by numerical damping, as the source obtains it. Steps that are short beside the periods leave the model
    on its way down: so starts modelisation B of SDLS119 (10 steps of 0.001 s with beta = 1, gamma = 1.5).
    """
    drive = Drive.static(operators, steps)
    with (
        at_rest(operators) as rest,
        Newmark(
            operators, scheme, step, damped=False, exact_uplift=exact_uplift, prefix="settle_", rigid_modes=rigid_modes
        ) as stepper,
    ):
        stepper.begin(rest, drive)
        for n in range(1, steps + 1):
            stepper.advance(drive, n, n)
        return stepper.state.copy()
