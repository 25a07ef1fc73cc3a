"""The choice of the modes that the exact march steps where nothing holds the body in some directions."""

import numpy as np

from uplift.solvers.time_domain.exact.first_order import _stepped_modes


def test_elastic_modes_are_not_static_beside_rigid_ones():
    force = np.ones((5, 1))
    assert _stepped_modes(np.array([0.0, 0.0, 10.0, 30.0, 90.0]), force, 2) == 5
    assert _stepped_modes(np.array([1e-9, 0.0, 10.0, 30.0, 1e9]), force, 2) == 4
    assert _stepped_modes(np.array([1.0, 2.0, 10.0, 30.0, 1e9]), force, 0) == 4
