"""The march of a time integration from instant to instant."""

from __future__ import annotations

import numpy as np

from uplift.solvers.history import History
from uplift.solvers.time_domain.energy import EnergyMeter
from uplift.solvers.time_domain.initial import balance_acceleration
from uplift.solvers.time_domain.march_store import KeptMarch
from uplift.solvers.time_domain.newmark import Newmark
from uplift.solvers.time_domain.observers import Observer, Record
from uplift.solvers.time_domain.state import State, load_scale, load_values
from uplift.solvers.watch import Loop, Watch


def transient(
    method: Newmark,
    start: State,
    steps: int,
    *,
    every: int = 1,
    release: np.ndarray | None = None,
    energy: bool = False,
    observer: Observer | None = None,
    watch: Watch | None = None,
) -> History:
    """March `steps` steps from time 0 and the state `start`, which is left as it is (collective).

    Every `every`-th step is archived. `release` (n_archived, n_channels) N are release forces known at the archived instants
    and interpolated linearly between them; without them uplift is exact, or left out, as `method` was made. `energy`
    keeps the ledger of energies, at three products of a matrix and a vector a step, unless auxiliary nodes have masses that count,
    whose energy it does not know. `observer` is shown the archived displacements. `watch` shows the progress and keeps checkpoints, from
    which the same march goes on to the same bits on as many ranks.
    """
    operators = method.operators
    times = method.step * np.arange(steps + 1)
    archived = times[::every]
    values = load_values(operators, times)
    method.load_scale = load_scale(operators, values)
    given = None
    if release is not None:
        given = np.stack([np.interp(times, archived, column) for column in release.T], axis=1)
    heavy = method.nodes if method.nodes.any and method.compliance is not None and given is None else None
    record = Record(operators, len(archived), EnergyMeter(operators) if energy and heavy is None else None, observer, heavy)
    with start.copy() as state:
        problem = method.compliance.problem if method.compliance is not None else None
        kept = KeptMarch(watch, operators.comm, problem, state, record)
        reached = kept.read()
        if reached < 0:
            if given is not None:
                state.release = given[0]
            elif method.compliance is None:
                state.release = np.zeros_like(state.release)
            balance_acceleration(operators, state, values[0], method.step, motions=method.motions)
            record.add(state, values[0], row=0)
            reached = 0
        elif record.meter is not None:
            record.meter.resume(state.displacement, state.velocity, values[reached])
        with Loop(watch, operators.comm, "steps", steps, reached, lambda: kept.save(n)) as loop:
            n = reached
            for n in range(reached + 1, steps + 1):
                method.advance(state, (values[n - 1], values[n]), None if given is None else given[n])
                record.add(state, values[n], row=n // every if n % every == 0 else None, step=method.step)
                if n >= loop.next and n < steps:
                    loop.meet(n)
            loop.finish()
    return record.history(archived)
