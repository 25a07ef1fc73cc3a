"""Convolution with a causal kernel while the input is still being made."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.fft


class OnlineConvolution:
    """The past's share sum_{m < n} kernel_{n-m} values_m, while values_n follows from it step by step.

    Steps are taken in blocks. Within a block the sum is direct; a block, and every pair, quadruple ... of blocks, once complete,
    sends its effect on as many steps ahead by FFT. Each pair (m, n) is counted once, at the middle of the smallest dyadic
    interval that holds both, so N steps cost N log^2 N instead of N^2.
    Source: Hairer, Lubich and Schlichte, SIAM J. Sci. Stat. Comput. 6 (1985) 532.
    """

    def __init__(self, kernel: np.ndarray, block: int = 64) -> None:
        """Take the kernel (nt, n_out, n_in) and the number of steps in a block, a power of two."""
        if block < 1 or block & (block - 1):
            raise ValueError(f"expected a power of two, got {block}")
        self._kernel = kernel
        self._block = block
        self._spectra: dict[int, np.ndarray] = {}

    def run(self, step: Callable[[int, np.ndarray], np.ndarray]) -> np.ndarray:
        """Call `step(n, past)` for n = 0, 1, ...: it takes the past's share (n_out,) and returns values_n (n_in,); return them all."""
        nt, n_out, n_in = self._kernel.shape
        values = np.zeros((nt, n_in))
        past = np.zeros((nt, n_out))
        # One row for each output, most recent step first: the direct sum within a block is one product with a leading part of it.
        flat = self._kernel[1 : self._block].transpose(1, 0, 2).reshape(n_out, -1)
        for n in range(nt):
            begin = n - n % self._block
            here = n - begin
            if here:
                past[n] += flat[:, : here * n_in] @ values[begin:n][::-1].ravel()
            values[n] = step(n, past[n])
            if (n + 1) % self._block == 0 and n + 1 < nt:
                self._send(n + 1, values, past)
        return values

    def _send(self, now: int, values: np.ndarray, past: np.ndarray) -> None:
        """Add the effect of the largest dyadic stretch that ends before step `now` to as many steps from there."""
        length = now & -now
        if length not in self._spectra:
            self._spectra[length] = scipy.fft.rfft(self._kernel[: 2 * length], 2 * length, axis=0)
        stretch = values[now - length : now]
        spectrum = np.einsum("foi,fi->fo", self._spectra[length], scipy.fft.rfft(stretch, 2 * length, axis=0))
        ahead = scipy.fft.irfft(spectrum, 2 * length, axis=0)[length:]
        reach = min(length, len(past) - now)
        past[now : now + reach] += ahead[:reach]
