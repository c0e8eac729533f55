r"""What the cylinder's face feels: forces and a moment beside that along its travel, the contact's width, its pressure.

Forces and the moment are a load cell's of several axes. The width is seen by ink, a camera or the edges of a pressure
film.

The skin is pressed up to where its deformed outline :math:`x(s)`, quadratic along every edge of the mesh, comes to the
face but for the gap :math:`g` at which the contact's pressure begins: :math:`|x(s) - c| = R + g`. The width is the arc
:math:`R\,(\varphi_1 - \varphi_0)` between the outermost of these points; as nodes move at the rates :math:`x'`, a point
slides along the outline so that it stays there. Pressure is seen by sensels: a film or a mat between the
cylinder and the skin.

A sensel that reaches along the face from :math:`a` to :math:`b` (mm, from the face's deepest point, to the left of the
travel) reads

.. math:: p = \frac{1}{b - a} \sum_n q_n \left[S((s_n - a) / w) - S((s_n - b) / w)\right]

of the nodes' normal loads :math:`q_n` (N per mm of the cylinder) at :math:`s_n`, with a smooth step :math:`S` from 0 to
1 over :math:`\pm w`, by which a film spreads a load. Sensels side by side add up to the whole load.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from math import comb
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from legfem.channels import Sight
from legfem.channels import kind as base
from legfem.common.errors import InputError
from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.geometry.indenter import Site
from legfem.geometry.section import across

if TYPE_CHECKING:
    from legfem.channels.seen import Seen


_SIX_AXES = base.ChannelAccuracy(reading=0.02, bias=0.05, gain=0.02, slow=0.03, lag=0.01)
"""Crosstalk of a six-axis cell is a per cent or two of the force along the travel."""
LATERAL = base.ChannelKind(
    "lateral_force",
    "N",
    "force of the cylinder on the skin across the travel",
    _SIX_AXES,
    models=frozenset({"2d", "3d"}),
    detail="to its left",
)
AXIAL = replace(
    LATERAL,
    name="axial_force",
    quantity="force of the cylinder on the skin along the leg",
    models=frozenset({"3d"}),
    presses=True,
    detail="towards greater z",
)
MOMENT = base.ChannelKind(
    "axis_moment",
    "Nmm",
    "moment of the cylinder on the skin about the cylinder's axis",
    base.ChannelAccuracy(reading=0.3, bias=1.0, gain=0.02, slow=0.5, lag=0.01),
    detail="counterclockwise in the section",
)
_PRESSED = 0.2
"""Share of the largest force along the travel from which on another force is compared with it."""


class ContactForces(base.ChannelFile):
    """Forces across the travel, to its left, and along the leg; and what friction turns the cylinder by."""

    kinds: ClassVar = (LATERAL, AXIAL, MOMENT)

    def read(self, seen: "Seen") -> base.Channels:
        """Return the force to the left; of a leg in 3D that along it, of a section the moment."""
        found = {LATERAL.name: seen.force(seen.left)}
        if len(seen.left) == 3:
            return found | {AXIAL.name: seen.force(np.array([0.0, 0.0, 1.0]))}
        return found | {MOMENT.name: seen.moment()}

    def plans(self, site: Site) -> Sequence[base.ChannelPlan]:
        """Return what load cells of more axes give."""
        lateral, both = "record the lateral force", "record the lateral force and the moment about the cylinder's axis"
        force, moment = Sight(LATERAL.name), Sight(MOMENT.name)
        return [
            base.ChannelPlan(f"{lateral} too", (force,), "a load cell of two or more axes, and no more time"),
            base.ChannelPlan(f"{both} too", (force, moment), "a six-axis load cell, and no more time"),
        ]

    def check(self, kind: base.ChannelKind, recorded: base.ReadingsAtSite) -> base.Impossible | None:
        """Refuse a lateral force that exceeds the force along the travel, and a moment that friction can't make."""
        pressed = recorded.force > _PRESSED * recorded.force.max()
        values, force = recorded.values[pressed], recorded.force[pressed]
        # A moment's arm is within the face; no lateral force exceeds the one along the travel.
        most = recorded.site.indenter.radius if kind == MOMENT else 1.0
        if kind == AXIAL or not len(values) or np.median(np.abs(values) / force) <= most:
            return None
        worst = float(np.abs(values).max())
        if kind == MOMENT:
            return base.Impossible(
                f"it is up to {worst:.3g} N mm, and friction of {force.max():.3g} N on the face makes less",
                "give it about the cylinder's axis, not about the load cell's origin, and check its unit",
            )
        problem = f"it is up to {worst:.3g} N, more than the force along the travel ({force.max():.3g} N)"
        return base.Impossible(problem, "check which of the load cell's axes is which, and its zero")


def _squared(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return the coefficients (n, 5) of 1, s, ... s^4 of the squares of a + b s + c s^2, vectors (n, 2)."""
    terms = [(a, a), (2 * a, b), (b, b), (2 * b, c), (c, c)]
    squares = np.array([np.einsum("nd,nd->n", one, other) for one, other in terms]).T
    squares[:, 2] += 2 * np.einsum("nd,nd->n", a, c)
    return squares


_BERNSTEIN = np.array([[comb(i, j) / comb(4, j) for j in range(5)] for i in range(5)])
"""From the coefficients of a polynomial of fourth degree to its Bernstein coefficients from 0 to 1."""
_SEEN = base.ChannelAccuracy(reading=0.7, bias=1.0, gain=0.03, slow=0.3, lag=0.1)
"""Accuracy of an edge that fades: skin that is close to the face looks as if it touched."""
WIDTH = base.ChannelKind("contact_width", "mm", "width of the contact along the cylinder's face", _SEEN, 0.02)


class ContactWidths(base.ChannelFile):
    """Arc between the outermost points of the skin that touch the cylinder."""

    kinds: ClassVar = (WIDTH,)

    def read(self, seen: "Seen") -> base.Channels:
        """Return the width; nothing before the skin touches."""
        skin, radius = seen.lines["skin"], seen.radius
        reach = radius + seen.onset
        # Of an edge from 0 to 1: a + b s + c s^2.
        first, last, middle = (skin.points - seen.centre).transpose(1, 0, 2)
        bend, rise = 2 * first + 2 * last - 4 * middle, 4 * middle - 3 * first - last
        beyond = _squared(first, rise, bend)
        beyond[:, 0] -= reach**2
        # A polynomial is within the hull of its Bernstein coefficients.
        hull = beyond @ _BERNSTEIN.T
        near = 1e-6 * np.abs(hull).max(axis=1)
        found: list[tuple[float, FloatArray]] = []
        for edge in np.flatnonzero((hull.min(axis=1) <= near) & (hull.max(axis=1) >= -near)):
            a, b, c = first[edge], rise[edge], bend[edge]
            roots = np.roots(beyond[edge, ::-1])
            for s in (float(root.real) for root in roots if abs(root.imag) < 1e-9 and -1e-9 <= root.real <= 1 + 1e-9):
                point, along = a + b * s + c * s**2, b + 2 * c * s
                shapes = np.array([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)])
                rates = shapes @ skin.rates[:, edge]
                moving = rates - np.outer(rates @ point / (along @ point), along)
                turn = np.array([-point[1], point[0]])
                ahead, sideways = point @ seen.model.system.direction, point @ seen.left
                found.append((radius * float(np.arctan2(sideways, ahead)), moving @ turn * radius / reach**2))
        if len(found) < 2:
            return {WIDTH.name: (0.0, np.zeros(len(skin.rates)))}
        right, left = min(found, key=lambda one: one[0]), max(found, key=lambda one: one[0])
        return {WIDTH.name: (left[0] - right[0], left[1] - right[1])}

    def plans(self, site: Site) -> Sequence[base.ChannelPlan]:
        """Return the width in single frames."""
        needed = "a camera along the cylinder, or ink on it"
        return [base.ChannelPlan("read how wide the contact is at {at}", (Sight(WIDTH.name),), needed, frames=True)]

    def check(self, kind: base.ChannelKind, recorded: base.ReadingsAtSite) -> base.Impossible | None:
        """Refuse a width of more than half the cylinder's face, or below nothing."""
        half = float(np.pi * recorded.site.indenter.radius)
        least, widest = float(recorded.values.min()), float(recorded.values.max())
        if least < -3 * recorded.accuracy.reading:
            return base.Impossible(f"it is down to {least:.3g} mm", "leave a cell empty where nothing could be read")
        if widest <= half:
            return None
        problem = f"it is up to {widest:.3g} mm, and half the cylinder's face is {half:.3g} mm"
        return base.Impossible(problem, "check its unit and the cylinder's diameter")

    def place(self, kind: base.ChannelKind, site: Site) -> FloatArray:
        """Return the face's deepest point at first touch."""
        return site.deepest


_FILM = base.ChannelAccuracy(
    reading=0.5, bias=0.3, gain=0.1, slow=0.2, lag=0.1, shift=1.0, each=0.05, creep=0.05, threshold=1.0
)
"""Accuracy of thin-film sensors on a curved face: a tenth of the reading, a twentieth of each sensel by itself, and as
much more for each decade of time; a film is laid around the cylinder by hand."""
PRESSURE = base.ChannelKind(
    "contact_pressure",
    "kPa",
    "pressure of the cylinder on the skin",
    _FILM,
    0.03,
    # Its sum is the force, which is measured: what outlines that are off by 0.3 to 1 mm do beyond the sum of their
    # single effects has either sign within the contact, 0.2 to 0.6 kPa at 20 mm on sensels of 6 mm.
    model_length=5.0,
    detail="in sensels along its face",
)
_BLUR_MM = 1.5
_MOST_SENSELS = 24
"""More are taken together, neighbours in twos, threes and so on."""
_MORE_THAN_FORCE = 1.5
"""Sum of the pressures over the force from which on they are refused."""
_NARROWEST_DEG = 1.6
"""A film that covers half the face has angles to π/2 in radians; none covers a thirtieth of it."""
_PLANNED_SENSELS = 8
"""Sensels of a film that a plan asks for."""
_PLANNED_MM, _PLANNED_DEG = 24.0, 80.0
"""How far that film reaches to either side at most, whichever is less."""


class ContactPressures(base.FramesFile[Site]):
    """Mean pressures over sensels; a place is where one begins and ends along the face, mm."""

    kinds: ClassVar = (PRESSURE,)
    entry = PRESSURE.name
    columns = ("angle_deg", "pressure_kPa")

    def read(self, seen: "Seen") -> base.Channels:
        """Return the pressures of the sensels that there are."""
        places = seen.places(PRESSURE.name)
        if not len(places):
            return {}
        (arc, arc_rates), (nodal, nodal_rates) = seen.face
        steps, slopes = _step((arc - places[..., None]) / _BLUR_MM)
        share, slope = steps[:, 0] - steps[:, 1], (slopes[:, 0] - slopes[:, 1]) / _BLUR_MM
        width = places[:, 1] - places[:, 0]
        load = seen.over_ranks(share @ nodal) / width
        rates = seen.over_ranks(nodal_rates @ share.T + arc_rates @ (slope * nodal).T) / width
        return PRESSURE.by_course(mpa_to_kpa(1.0) * load, mpa_to_kpa(1.0) * rates)

    def plans(self, site: Site) -> Sequence[base.ChannelPlan]:
        """Return a film of a few sensels about the face's deepest point."""
        half = min(_PLANNED_MM, np.deg2rad(_PLANNED_DEG) * site.indenter.radius)
        edges = [round(float(edge), 4) for edge in np.linspace(-half, half, _PLANNED_SENSELS + 1)]
        asks, needed = "lay a pressure film around the cylinder", "a pressure film or mat with its reader"
        return [base.ChannelPlan(asks, (Sight(PRESSURE.name, tuple(pairwise(edges))),), needed)]

    def check(self, kind: base.ChannelKind, recorded: base.ReadingsAtSite) -> base.Impossible | None:
        """Refuse pressures whose sum exceeds the force by far: no film's gain is off by so much."""
        pressed = np.flatnonzero(recorded.force > 0.5 * recorded.force.max())
        width = recorded.places[:, 1] - recorded.places[:, 0]
        angle = recorded.places.mean(axis=1) / recorded.site.indenter.radius
        # Of the sensels that read at about one force: kPa over mm2 are mN.
        load = 1e-3 * recorded.values * width * np.cos(angle) * recorded.site.indenter.length
        found = [float(load[recorded.force == at].sum() / at) for at in np.unique(recorded.force[pressed])]
        if not found or np.median(found) <= _MORE_THAN_FORCE:
            return None
        remedy = "check their unit, and that angles are those of the sensels' middles about the cylinder's axis"
        return base.Impossible(f"the pressures add up to {np.median(found):.2g} times the force", remedy)

    def arrows(self, places: FloatArray, site: Site) -> tuple[FloatArray, FloatArray]:
        """Return the sensels' middles on the face at first touch, and the directions in which they press."""
        angle = places.mean(axis=1) / site.indenter.radius
        ways = np.cos(angle)[:, None] * site.direction + np.sin(angle)[:, None] * across(site.direction)
        return site.touch + site.indenter.radius * ways, ways

    def apart(self, places: FloatArray) -> FloatArray:
        """Return how far the sensels' middles are apart along the face."""
        middles = places.mean(axis=1)
        return np.abs(np.subtract.outer(middles, middles))

    def shared(self, read: base.PlacedReadings, accuracy: base.ChannelAccuracy) -> dict[str, FloatArray]:
        """Return what a film's creep does, and what a film that lies beside where it is said to."""
        found: dict[str, FloatArray] = {}
        if accuracy.creep:
            found["creep"] = accuracy.creep * np.log10(1.0 + np.maximum(read.time, 0.0)) * read.values
        if accuracy.shift:
            found["place"] = accuracy.shift * _along_face(read)
        return found

    def of_frames(self, frames: Sequence[base.Frames], site: Site) -> Sequence[Sequence[base.Read]]:
        """Return the sensels' pressures; a sensel reaches half-way to its neighbours."""
        angles = np.unique(np.concatenate([one.columns[:, 0] for one in frames]))
        refused = partial(InputError, "frames", "angle_deg")
        if len(angles) < 2:
            raise refused(f"{len(angles)} sensel", "give the pressures of two sensels at least")
        widest = np.abs(angles).max()
        if widest > 90.0:
            remedy = "give the angle of a sensel's middle from the face's deepest point, to the left of the travel"
            raise refused(f"is up to {widest:.0f}: the skin touches within 90 degrees of the line of travel", remedy)
        if widest <= _NARROWEST_DEG:
            raise refused(f"is within ± {widest:.3g}, as it would be in radians", "give it in degrees")
        between = 0.5 * (angles[1:] + angles[:-1])
        ends = np.concatenate([[2 * angles[0] - between[0]], between, [2 * angles[-1] - between[-1]]])
        ends = np.deg2rad(ends) * site.indenter.radius
        group = np.arange(len(angles)) // -(-len(angles) // _MOST_SENSELS)
        first = np.flatnonzero(np.diff(group, prepend=-1))
        edges = np.append(ends[first], ends[-1])
        places = tuple((round(float(a), 4), round(float(b), 4)) for a, b in pairwise(edges))
        found = []
        for one in frames:
            sensel = np.searchsorted(angles, one.columns[:, 0])
            keys, row = np.unique(np.column_stack([one.time, group[sensel]]), axis=0, return_inverse=True)
            widths = np.diff(ends)[sensel]
            means = np.bincount(row.ravel(), widths * one.columns[:, 1]) / np.bincount(row.ravel(), widths)
            found.append([base.Read(PRESSURE.name, keys[:, 0], means, keys[:, 1].astype(int), places)])
        return found

    def place(self, kind: base.ChannelKind, site: Site) -> FloatArray:
        """Return the face's deepest point at first touch."""
        return site.deepest


def _along_face(read: base.PlacedReadings) -> FloatArray:
    """Return the derivative (k,) of each frame's pressures by the place on the face, kPa/mm."""
    middles, found = read.places.mean(axis=1), np.zeros(len(read.values))
    for frame in np.unique(read.frame):
        mine = np.flatnonzero(read.frame == frame)
        if len(mine) > 1:
            mine = mine[np.argsort(middles[mine])]
            found[mine] = np.gradient(read.values[mine], middles[mine])
    return found


def _step(t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a smooth step from 0 at -1 to 1 at 1, and its slope."""
    inside = np.clip(t, -1.0, 1.0)
    return 0.5 + 0.75 * inside - 0.25 * inside**3, 0.75 * (1 - inside**2)
