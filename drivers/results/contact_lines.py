"""Contacts that stand in a line: what they push with per length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

STRAIGHT = 1e-6
"""Points off a line by less than this part of its length are on it."""


@dataclass(frozen=True)
class ContactLine:
    """Contacts on one straight line, in order along it."""

    name: str
    contacts: np.ndarray
    """(n,) indices of the contacts."""
    position: np.ndarray
    """(n,) m along the line, from its first contact."""
    share: np.ndarray
    """(n,) m of line that belong to each contact: half the way to each neighbour. They add up to the line."""

    def pressure(self, force: np.ndarray) -> np.ndarray:
        """Return the force per length (nt, n) N/m of contact forces (nt, n_c) N; its integral over the line is their sum."""
        return force[:, self.contacts] / self.share


def contact_lines(groups: dict[str, np.ndarray], points: np.ndarray) -> list[ContactLine]:
    """Return a line for each group of contacts, name -> (n,) indices, whose points (n_c, 2 or 3) m are different and collinear."""
    lines = []
    for name, members in groups.items():
        if len(members) < 2:
            continue
        here = points[members]
        middle = here.mean(axis=0)
        direction = np.linalg.svd(here - middle)[2][0]
        direction = direction * (1.0 if direction[int(np.argmax(np.abs(direction)))] > 0 else -1.0)
        along = (here - middle) @ direction
        off = np.linalg.norm(here - middle - along[:, None] * direction, axis=1)
        order = np.argsort(along, kind="stable")
        position = along[order] - along[order[0]]
        gaps = np.diff(position)
        if np.max(off) > STRAIGHT * position[-1] or np.min(gaps) <= STRAIGHT * position[-1]:
            continue
        share = 0.5 * (np.append(gaps, 0.0) + np.insert(gaps, 0, 0.0))
        lines.append(ContactLine(name, np.asarray(members)[order], position, share))
    return lines
