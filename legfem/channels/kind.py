"""What a channel is: its name, unit and usual accuracy, and what a file that adds one has to say of it."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from legfem.channels import Sight
from legfem.channels.laid import AS_STATED, STEP_DEG, STEP_MM, Laid
from legfem.common.units import FloatArray
from legfem.geometry.indenter import Site

if TYPE_CHECKING:
    from legfem.channels.seen import Seen

Channels = Mapping[str, tuple[float, FloatArray]]
"""Value and derivatives (p,) by a course's name."""


@dataclass(frozen=True)
class ChannelAccuracy:
    """Standard deviations of a channel's errors, in its unit unless stated; relative ones are dimensionless."""

    reading: float
    """Standard deviation of a single reading, independent of the others."""
    bias: float = 0.0
    """Standard deviation of an error that all of a site's readings share."""
    gain: float = 0.0
    """Standard deviation of a relative error that all of a site's readings share."""
    slow: float = 0.0
    """Standard deviation of an error that changes slowly along the test."""
    lag: float = 0.0
    """Standard deviation of the channel's clock from the recording's, s."""
    shift: float = 0.0
    """Standard deviation of an image's place in the section, in either direction, or of a film's along the face, mm."""
    turn: float = 0.0
    """Standard deviation of an image's rotation in the section, degrees."""
    apart: float = 0.0
    """Correlation length of the errors of one frame's readings, mm."""
    each: float = 0.0
    """Standard deviation of each place's relative error, which all of its readings share."""
    creep: float = 0.0
    """Standard deviation of the relative error per decade of time under load, which all of a site's readings share."""
    threshold: float | None = None
    """Below which readings say nothing, and are left out."""

    @property
    def laid(self) -> Mapping[str, float]:
        """Standard deviations of how an image lies, over a step, by those of the ways that aren't exact."""
        steps = {"shift in x": self.shift / STEP_MM, "shift in y": self.shift / STEP_MM, "turn": self.turn / STEP_DEG}
        return {way: times for way, times in steps.items() if times > 0}


@dataclass(frozen=True)
class ChannelKind:
    """One kind of channel.

    Parameters
    ----------
    name
        As in columns of a recording, which end with the unit.
    unit
        Unit of its values.
    quantity
        What it is, for a sentence that begins with "The".
    usual
        Accuracy where none is stated.
    model_share
        Standard deviation of a model's error over the displacement, in the unit per mm: effects at once, and outlines
        that are off beside them, are more than the sum of each.
    """

    name: str
    unit: str
    quantity: str
    usual: ChannelAccuracy
    model_share: float = 0.0
    model_length: float = 10.0
    """Correlation length of that error between places, mm."""
    models: frozenset[str] = frozenset({"2d"})
    """Which models give it: of a leg's section (2d), of a leg in 3D (3d), or of a specimen."""
    at_rest: float = 0.0
    """Value that is read as it is whatever the instrument's gain: what readings are shares of."""
    image: str = ""
    """What is laid into the section, and may lie beside where it is said to, to read this in it; nothing of others."""
    presses: bool = False
    """Whether it is the force that presses in a file that has no other."""
    detail: str = ""
    """Where or which way it is read, to follow the quantity."""

    @property
    def words(self) -> str:
        """What it is, with where or which way it is read."""
        return f"{self.quantity}, {self.detail}" if self.detail else self.quantity

    @property
    def column(self) -> str:
        """Column of a recording that holds it."""
        return self.name if self.unit == "-" else f"{self.name}_{self.unit}"

    @property
    def title(self) -> str:
        """Its name as a page writes it."""
        return self.name.replace("_", " ")

    @property
    def is_force(self) -> bool:
        """Whether it is a force on the cylinder."""
        return self.unit == "N"

    @property
    def follows_force(self) -> bool:
        """Whether it is a force, moment or pressure on the cylinder: what acts on the force by a factor acts on it."""
        return self.unit in ("N", "Nmm", "kPa")

    def courses(self, places: int) -> tuple[str, ...]:
        """Return the names of its courses along a test: one, or one for each of a number of places."""
        return tuple(f"{self.name}:{k}" for k in range(places)) if places else (self.name,)

    def by_course(self, values: FloatArray, rates: FloatArray) -> Channels:
        """Return values (k,) at places, and their derivatives (p, k), by the names of its courses."""
        each = zip(self.courses(len(values)), values, rates.T, strict=True)
        return {name: (float(value), by) for name, value, by in each}


@dataclass(frozen=True, eq=False)
class PlacedReadings:
    """Readings of a channel that is seen at places; arrays are (k,).

    Parameters
    ----------
    places
        Places of the readings, (k, q).
    time
        Since first contact, s.
    frame
        Number of each reading's frame.
    values
        In the channel's unit.
    """

    places: FloatArray
    time: FloatArray
    frame: NDArray[np.int_]
    values: FloatArray


@dataclass(frozen=True, eq=False)
class ReadingsAtSite:
    """What a channel read in a trial, beside what is known of the trial; arrays are (k,).

    Parameters
    ----------
    values
        In the channel's unit.
    depth
        Depth of the cylinder after first contact where the reading lies in the first loading, mm; NaN elsewhere.
    force
        Along the travel, N.
    accuracy
        Accuracy of the instrument.
    site
        Where the leg is pressed.
    outline_sd
        Standard deviation of the section's outlines, mm.
    places
        Where each was read, (k, q).
    """

    values: FloatArray
    depth: FloatArray
    force: FloatArray
    accuracy: ChannelAccuracy
    site: Site
    outline_sd: float
    places: FloatArray


@dataclass(frozen=True)
class Impossible:
    """What a channel can't be, and how to mend it."""

    what: str
    remedy: str


@dataclass(frozen=True, eq=False)
class Frames:
    """A table of several readings a time, as it was read: points of the skin, sensels, or points within the section.

    Parameters
    ----------
    time
        Time of each row, (n,), s, on the recording's clock.
    columns
        The others of the table, (n, q), in its order.
    trial_time, trial_force
        Clock and force of the recording, (m,): s, and N.
    left_out
        How many readings of the file aren't in the table, by the reason.
    cells
        Greatest number of cells in which points are taken together, where the file's entry has one.
    """

    time: FloatArray
    columns: FloatArray
    trial_time: FloatArray
    trial_force: FloatArray
    left_out: Mapping[str, int] = field(default_factory=dict)
    cells: int | None = None


@dataclass(frozen=True, eq=False)
class Read:
    """What frames give of one channel.

    Parameters
    ----------
    name
        Name of its kind.
    time, values : (k,) array
        s, not falling, and the kind's unit.
    course : (k,) int array
        Number of the place that each reading was taken at; none of a channel that has but one course.
    places
        The same in all trials of a site.
    left_out
        How many readings of the file aren't among these, by the reason.
    """

    name: str
    time: FloatArray
    values: FloatArray
    course: NDArray[np.int_] | None = None
    places: tuple[tuple[float, ...], ...] = ()
    left_out: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class ChannelPlan:
    """A way to record channels that a plan may recommend.

    Parameters
    ----------
    asks
        What to do, as "record the lateral force too"; ``{at}`` stands for the displacements of single frames.
    channels
        Kinds, and the places at which each would be seen.
    effort
        What it takes.
    frames
        Whether it is recorded in single frames, or all along the test.
    """

    asks: str
    channels: tuple[Sight, ...]
    effort: str
    frames: bool = False


class ChannelFile:
    """What one file of ``legfem/channels/kinds`` adds: kinds that are read in the same way.

    One has `read`, or `laid` where its kinds are read in images.
    """

    kinds: ClassVar[tuple[ChannelKind, ...]]
    coordinates: ClassVar[int] = 0
    """How many numbers of a place are coordinates; what follows them tells readings at one point apart."""

    def read(self, seen: "Seen") -> Channels:
        """Return what there is of its kinds in a state; collective over the system's ranks."""
        (found,) = self.laid(seen, [AS_STATED]) or [{}]
        return found

    def laid(self, seen: "Seen", images: Sequence[Laid]) -> Sequence[Channels]:
        """Return what there is in a state of its kinds that are read in images, for each of some that lie elsewhere."""
        return []

    def plans(self, site: Site) -> Sequence[ChannelPlan]:
        """Return the ways to record its kinds at a site that a plan may recommend."""
        return ()

    def check(self, kind: ChannelKind, recorded: ReadingsAtSite) -> Impossible | None:
        """Return why a recorded channel can't be one of the kind; None where it can."""
        return None

    def place(self, kind: ChannelKind, site: Site) -> FloatArray:
        """Return where in the section it is seen (2,), mm: where the cylinder touches, if it doesn't say otherwise."""
        return site.touch

    def arrows(self, places: FloatArray, site: Site) -> tuple[FloatArray, FloatArray]:
        """Return where readings at places (k, q) are, mm, and unit vectors that they count along, (k, 2).

        None, (0, 2), of what has no direction.
        """
        return np.zeros((0, 2)), np.zeros((0, 2))

    def apart(self, places: FloatArray) -> FloatArray:
        """Return how far apart readings at places (k, q) are, (k, k), mm; infinite for unlike ones."""
        at, way = places[:, : self.coordinates], places[:, self.coordinates :]
        related = (way[:, None] == way[None]).all(axis=-1)
        return np.where(related, np.linalg.norm(at[:, None] - at[None], axis=-1), np.inf)

    def shared(self, read: PlacedReadings, accuracy: ChannelAccuracy) -> dict[str, FloatArray]:
        """Return by name what one standard deviation of an error does that all readings share, (k,).

        Only channels with places have one, as of a film that creeps.

        Parameters
        ----------
        read
            The readings, as predicted.
        accuracy
            Accuracy of the instrument.
        """
        return {}


@dataclass(frozen=True)
class Face:
    """The free face of a specimen, as a camera sees it.

    Parameters
    ----------
    half_height
        Half the undeformed size along its axis, mm.
    half_width
        Half the size across, mm; None where nobody states it.
    """

    half_height: float
    half_width: float | None = None


class FramesFile[Where](ChannelFile):
    """Kinds that a file of frames gives: several readings a time, in a table of ``time_s`` and `columns`.

    They are read where the leg was pressed, a `Site`, or on the specimens' faces, one a recording.
    """

    entry: ClassVar[str]
    """Key of the file in ``[channels]``."""
    columns: ClassVar[tuple[str, ...]]
    """Names of the table's columns after ``time_s``."""

    @abstractmethod
    def of_frames(self, frames: Sequence[Frames], site: Where) -> Sequence[Sequence[Read]]:
        """Return the channels that every trial's frames give.

        Raises
        ------
        InputError
            If they can't.
        """
