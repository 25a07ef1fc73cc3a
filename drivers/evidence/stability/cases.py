"""One row of the stability table, and how a whole history is compared with the independent model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from uplift.drivers.evidence.stability.bench import ROUND_OFF, Bench, Finding
from uplift.drivers.evidence.stability.oracle import EXTENDED


@dataclass(frozen=True)
class Case:
    """One row of the table."""

    group: str
    name: str
    what: str
    """What is done, and why it tells right from wrong."""
    run: Callable[[Bench], Finding]
    limit: float = ROUND_OFF
    origin: str = "round-off"
    """Where the limit comes from."""
    quick: bool = False


def dense(changes: dict[str, Any], precision: type = EXTENDED) -> Callable[[Bench], Finding]:
    """Return the comparison of the whole history of a changed scene with the independent model."""
    return lambda bench: bench.against_dense(changes, precision)
