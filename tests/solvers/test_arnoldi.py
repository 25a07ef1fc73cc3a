"""Pairs in coordinates against the Krylov space of the model of first order and twice the size, in dense algebra."""

import numpy as np
import pytest
from scipy import linalg

from uplift.solvers.bases.arnoldi import PairSpace

SIZE, COLUMNS = 9, 2


def test_pairs_span_the_space_of_first_order():
    rng = np.random.default_rng(3)
    upper, lower = rng.normal(size=(2, SIZE, SIZE))
    answers = rng.normal(size=(SIZE, COLUMNS))
    whole = np.block([[upper, lower], [np.eye(SIZE), np.zeros((SIZE, SIZE))]])
    powers = [np.vstack([answers, np.zeros_like(answers)])]
    basis, pairs, found = np.zeros((SIZE, 0)), PairSpace(), []
    for _ in range(4):
        new = answers - basis @ (basis.T @ answers)
        basis = np.hstack([basis, linalg.orth(new - basis @ (basis.T @ new))])
        assert pairs.add(basis.T @ answers) == COLUMNS
        x, y = (basis @ half for half in pairs.last(basis.shape[1]))
        found.append(np.vstack([x, y]))
        powers.append(whole @ powers[-1])
        answers = upper @ x + lower @ y
    held = np.hstack(found)
    assert held.T @ held == pytest.approx(np.eye(held.shape[1]), abs=1e-13)
    for power in powers[:-1]:
        assert held @ (held.T @ power) == pytest.approx(power, abs=1e-9 * np.max(np.abs(power)))


def test_the_space_ends():
    """A projector gives one new block of pairs, and then no more."""
    pairs = PairSpace()
    start = np.eye(2)[:, :1]
    assert pairs.add(start) == 1
    assert pairs.add(pairs.last(2)[0]) == 1
    assert pairs.add(pairs.last(2)[0]) == 0
