import numpy as np
import pytest

from uplift.solvers.frequency_domain.convolution import OnlineConvolution


def direct(kernel, values):
    return np.array([sum((kernel[n - m] @ values[m] for m in range(n)), np.zeros(kernel.shape[1])) for n in range(len(values))])


@pytest.mark.parametrize("block", [1, 4, 16, 256])
@pytest.mark.parametrize("steps", [1, 5, 64, 200])
def test_past_equals_the_plain_sum(block, steps):
    """A recurrence in which each value depends on all before it."""
    rng = np.random.default_rng(8)
    kernel = rng.normal(size=(steps, 2, 3)) * np.exp(-0.1 * np.arange(steps))[:, None, None]
    forcing = rng.normal(size=(steps, 3))
    mix = 0.1 * rng.normal(size=(3, 2))
    seen = []

    def step(n, past):
        seen.append(past.copy())
        return forcing[n] + mix @ past

    values = OnlineConvolution(kernel, block).run(step)
    expected = direct(kernel, values)
    assert np.max(np.abs(np.array(seen) - expected)) < 1e-12 * max(1.0, np.max(np.abs(expected)))
    assert values == pytest.approx(forcing + expected @ mix.T, abs=1e-10)


def test_block_is_a_power_of_two():
    with pytest.raises(ValueError, match="power of two"):
        OnlineConvolution(np.zeros((4, 1, 1)), 6)
