import numpy as np
import pytest

from uplift.solvers.frequency_domain import fourier


def test_convention_is_the_documented_sum():
    x = np.random.default_rng(1).normal(size=(16, 2))
    n = np.arange(16)
    for k, here in enumerate(fourier.forward(x)):
        assert here == pytest.approx(np.exp(-2j * np.pi * k * n / 16) @ x, abs=1e-13)


def test_inverse_returns_the_samples_and_parseval_holds():
    x = np.random.default_rng(2).normal(size=(2048, 3))
    spectrum = fourier.forward(x)
    assert fourier.inverse(spectrum, 2048) == pytest.approx(x, abs=1e-14)
    weight = np.full(len(spectrum), 2.0)
    weight[[0, -1]] = 1.0  # mean and Nyquist term stand once in the two-sided spectrum
    assert weight @ np.abs(spectrum) ** 2 / 2048 == pytest.approx(np.sum(x**2, axis=0), rel=1e-13)


@pytest.mark.parametrize("kept", [1, 300, 1024, 1025])
def test_fft_and_plain_sum_agree(kept):
    spectrum = fourier.forward(np.random.default_rng(3).normal(size=(2048, 2)))[:kept]
    assert np.max(np.abs(fourier.inverse(spectrum, 2048) - fourier.inverse_by_sum(spectrum, 2048))) < 1e-14


def test_a_cosine_keeps_its_amplitude_through_a_zero_extension():
    t = np.arange(64) / 64
    spectrum = fourier.forward(3 + 2 * np.cos(2 * np.pi * 5 * t))[:6]
    fine = np.arange(256) / 256
    assert fourier.inverse(spectrum, 256) * 4 == pytest.approx(3 + 2 * np.cos(2 * np.pi * 5 * fine), abs=1e-13)
