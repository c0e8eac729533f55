"""How much of every pixel a closed contour covers."""

from __future__ import annotations

import numpy as np

from legfem.common.units import FloatArray


def coverage(
    contour: FloatArray, origin: FloatArray, spacing: FloatArray, shape: tuple[int, int], lines: int = 4
) -> FloatArray:
    """Return the covered share of every pixel, exact along x and sampled along y.

    A line at some y enters and leaves the contour at crossings; a pixel's share on the line is what
    lies to the right of the crossings, counted with their signs.

    Parameters
    ----------
    contour : (n, 2) array
        Closed, counter-clockwise, mm.
    origin, spacing : (2,) array
        Centre of the pixel [0, 0], and between centres (mm).
    shape : (n_x, n_y)
        Of the image.
    lines : int
        Lines a pixel.

    Returns
    -------
    ndarray
        (n_x, n_y), 0 to 1.
    """
    # In pixels; pixel i reaches from i to i + 1.
    xy = (contour - origin) / spacing + 0.5
    first = np.clip(np.floor(xy.min(axis=0)).astype(int), 0, shape)
    last = np.clip(np.ceil(xy.max(axis=0)).astype(int), first, shape)
    covered = np.zeros(shape)
    n_x, n_y = last - first
    if n_x == 0 or n_y == 0:
        return covered
    start = xy - first
    end = np.roll(start, -1, axis=0)
    at = (np.arange(n_y * lines) + 0.5) / lines
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    edge, line = np.nonzero((low[:, None] <= at) & (at < high[:, None]))
    rise = end[edge, 1] - start[edge, 1]
    x = start[edge, 0] + (at[line] - start[edge, 1]) / rise * (end[edge, 0] - start[edge, 0])
    sign = -np.sign(rise)  # a counter-clockwise contour is entered, from the left, going down
    x = np.clip(x, 0.0, n_x - 1e-9)
    pixel = x.astype(int)
    steps = np.zeros((n_x + 1, n_y * lines))
    share = pixel + 1 - x
    np.add.at(steps, (pixel, line), sign * share)
    np.add.at(steps, (pixel + 1, line), sign * (1 - share))
    shares = np.cumsum(steps, axis=0)[:n_x].reshape(n_x, n_y, lines).mean(axis=2)
    covered[first[0] : last[0], first[1] : last[1]] = shares
    return covered
