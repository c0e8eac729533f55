"""In how many ways a leg is pressed, and what that leaves untold of its fibres."""

from __future__ import annotations

from legfem.legs.subject import SitedLeg

_UNLIKE_DEG = 30.0
"""By which cylinders have to lie otherwise to bend fibres otherwise."""


def ways_of_pressing(leg: SitedLeg) -> int:
    """Return how many ways a leg is pressed in, by which its fibres are bent otherwise."""
    shapes = {site.indenter.shape for site in leg.sites}
    turns = sorted(
        {abs((site.indenter.axis_deg + 90.0) % 180.0 - 90.0) for site in leg.sites if site.indenter.shape == "cylinder"}
    )
    unlike = len(turns) > 1 and turns[-1] - turns[0] >= _UNLIKE_DEG
    return len(shapes) + unlike


def untold_of_fibres(leg: SitedLeg) -> str:
    """Return why the fibres' ratio can't be told from C10; empty where it can."""
    if ways_of_pressing(leg) > 1:
        return ""
    how = leg.sites[0].indenter
    where = "all sites are" if len(leg.sites) > 1 else "the leg is"
    return (
        f"The fibres' ratio can't be told from C10: {where} pressed in one way (by a {how}), and "
        "more of the one looks like more of the other. Press in another way too (a cylinder across "
        "the leg: axis_deg = 90; a punch, a ball), or state the ratio (fibre_ratio, "
        "[[elastography]])."
    )
