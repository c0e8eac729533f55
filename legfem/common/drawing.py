"""What was loaded, as a notebook shows it: a line, and pictures that load nothing and need no package."""

import html
from collections.abc import Sequence
from typing import Any

import numpy as np

from legfem.common.units import FloatArray

SIZE = 200
"""Width and height of a picture, px."""
MOST = 300
"""Points of a line, at most."""


class Pictured:
    """What shows itself in a line, in place of its arrays, and by pictures."""

    def told(self) -> str:
        """What it is, in a line: of a leg or specimens whose they are, and where the data come from."""
        given: Any = self
        return f"{given.title}, {given.origin}"

    def pictures(self) -> str:
        """What it looks like, as SVG: what it holds, one beside the other."""
        held = [one for value in vars(self).values() for one in (value if isinstance(value, tuple) else (value,))]
        return "".join(one.pictures() for one in held if isinstance(one, Pictured))

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.told()}>"

    def _repr_html_(self) -> str:
        return f"<div>{html.escape(self.told())}</div>{self.pictures()}"


def svg(lines: Sequence[FloatArray], caption: str, to_scale: bool = False) -> str:
    """Return lines in a frame as SVG.

    Parameters
    ----------
    lines : sequence of (n, 2) arrays
        x and y, finite; one line at least.
    caption
        Of the picture, with its extent: axes have no numbers.
    to_scale
        Whether x and y are lengths of one scale; else each fills the frame.
    """
    low, high = np.min([line.min(axis=0) for line in lines], 0), np.max([line.max(axis=0) for line in lines], 0)
    extent = np.maximum(high - low, 1e-9)
    scale = SIZE / (extent.max() if to_scale else extent)
    thinned = [scale * (line[:: 1 + len(line) // MOST] - low) for line in lines]
    drawn = [" ".join(f"{x:.1f},{SIZE - y:.1f}" for x, y in line) for line in thinned]
    shapes = "".join(f'<polyline points="{points}" fill="none" stroke="currentColor"/>' for points in drawn)
    text = html.escape(caption)
    return (
        '<figure style="display: inline-block; margin: 0.5em">'
        f'<svg role="img" aria-label="{text}" width="{SIZE}" viewBox="-2 -2 {SIZE + 4} {SIZE + 4}">{shapes}</svg>'
        f"<figcaption>{text}</figcaption></figure>"
    )
