"""Real roots of real trigonometric polynomials, many at once.

    F(q) = sum over k = -d ... d of c_k exp(i k q),   c_-k = conj(c_k)

is known by 2 d + 1 or more equidistant samples. With q = q_0 + pi + 2 atan t,

    (1 + t^2)^d F = sum of c_k exp(i k (q_0 + pi)) (1 + i t)^(d + k) (1 - i t)^(d - k)

is a real polynomial of degree 2 d in t, whose roots are the eigenvalues of its companion matrix. Its leading
coefficient is F(q_0): where q_0 is the sample of largest size it never vanishes, whatever the degree of F really is
(degrees that are missing are roots t = +-i). The roots exp(i q) of the polynomial with the coefficients c_k would be
eigenvalues of a complex matrix, which take three times as long, and are lost where c_d vanishes.
"""

from __future__ import annotations

from functools import cache

import numpy as np

_NEARLY_REAL = 1e-2


@cache
def _conversion(degree: int) -> np.ndarray:
    """Coefficients (2 d + 1, d + 1) of (1 + i t)^(d + k) (1 - i t)^(d - k) for k = 0 ... d, highest power first."""
    columns = [
        (-1.0) ** k * np.poly([1j] * (degree + k) + [-1j] * (degree - k))
        for k in range(degree + 1)
    ]
    return np.stack(columns, axis=1)


def sample_angles(degree: int) -> np.ndarray:
    """Equidistant angles (S,) at which `real_roots` wants its samples; S is a power of two above 2 d + 1."""
    count = 1 << (2 * degree + 1).bit_length()
    return 2.0 * np.pi * np.arange(count) / count


def real_roots(samples: np.ndarray, degree: int) -> np.ndarray:
    """Find the real roots, and what may be real roots but for rounding.

    Parameters
    ----------
    samples : (S, K) ndarray
        K polynomials at the `sample_angles`.
    degree : int
        d, or more than it.

    Returns
    -------
    (2 d, K) ndarray
        Angles, of any turn; NaN for roots with an imaginary part above 0.01, and where samples are not finite or all
        zero.
    """
    count = len(samples)
    size = np.abs(samples).max(axis=0)
    sound = np.isfinite(size) & (size > 0.0)
    samples = np.where(sound, samples, 1.0) / np.where(sound, size, 1.0)
    start = 2.0 * np.pi * np.argmax(np.abs(samples), axis=0) / count + np.pi
    harmonics = np.fft.rfft(samples, axis=0)[: degree + 1] * np.exp(
        1j * np.arange(degree + 1)[:, None] * start
    )
    harmonics[1:] *= 2.0
    coefficients = (_conversion(degree) @ harmonics).real
    companion = np.zeros((samples.shape[1], 2 * degree, 2 * degree))
    companion[:, np.arange(1, 2 * degree), np.arange(2 * degree - 1)] = 1.0
    companion[:, 0] = -(coefficients[1:] / coefficients[0]).T
    t = np.linalg.eigvals(companion).T
    real = 2.0 * np.abs(t.imag) < _NEARLY_REAL * (1.0 + t.real**2)
    return np.where(real & sound, start + 2.0 * np.arctan(t.real), np.nan)
