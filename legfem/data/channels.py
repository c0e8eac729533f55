"""Channels that a test records beside its force: what each is, and how accurate it usually is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from legfem.common.units import FloatArray, frozen_array


@dataclass(frozen=True)
class ChannelAccuracy:
    """Standard deviations of a channel's errors, in the channel's unit unless stated."""

    reading: float
    """Of a single reading, independent of the others."""
    bias: float = 0.0
    """Of an error that is the same in all of a site's readings."""
    gain: float = 0.0
    """Of a relative error that is the same in all of a site's readings, dimensionless."""
    slow: float = 0.0
    """Of an error that changes slowly along the test."""
    lag: float = 0.0
    """Of the channel's clock against the recording's, s."""


@dataclass(frozen=True)
class ChannelKind:
    """One kind of channel.

    Parameters
    ----------
    name
        As in columns of a recording, which end with the unit.
    unit
        Of its values.
    words
        What it is, for a sentence that begins with "The".
    usual
        Accuracy where none is stated.
    model_share
        Standard deviation of a model's error over the displacement, in the unit per mm: effects at once, and outlines
        that are off beside them, are more than the sum of each.
    """

    name: str
    unit: str
    words: str
    usual: ChannelAccuracy
    model_share: float = 0.0
    models: frozenset[str] = frozenset({"2d"})
    """Which of a leg's models give it: of its section, or in 3D."""

    @property
    def column(self) -> str:
        """Column of a recording that holds it."""
        return f"{self.name}_{self.unit}"

    @property
    def is_force(self) -> bool:
        """Whether it is a force on the cylinder; else it is a length."""
        return self.unit == "N"


_ULTRASOUND = ChannelAccuracy(reading=0.3, bias=0.3, gain=0.02, slow=0.1, lag=0.1)
"""Wall-to-wall distances in B-mode images: a pixel or two, the boundary's choice and the speed of sound."""
_SIX_AXES = ChannelAccuracy(reading=0.02, bias=0.05, gain=0.02, slow=0.03, lag=0.01)
"""Crosstalk of a six-axis cell is a per cent or two of the force along the travel."""
_CAMERAS = ChannelAccuracy(reading=0.2, bias=0.2, slow=0.2, lag=0.05)


def _rise(side: str, beside: int) -> ChannelKind:
    words = f"rise of the skin {beside} mm to the {side} of the line of travel since first touch"
    return ChannelKind(f"skin_rise_{side}_{beside}", "mm", words, _CAMERAS, 0.012)


CHANNELS = {
    kind.name: kind
    for kind in (
        ChannelKind(
            "lateral_force",
            "N",
            "force of the cylinder on the skin across the travel, to its left",
            _SIX_AXES,
            models=frozenset({"2d", "3d"}),
        ),
        ChannelKind(
            "axial_force",
            "N",
            "force of the cylinder on the skin along the leg, towards greater z",
            _SIX_AXES,
            models=frozenset({"3d"}),
        ),
        ChannelKind(
            "fat_thickness",
            "mm",
            "thickness of the fat under the cylinder, along the line of travel",
            _ULTRASOUND,
            0.002,
        ),
        ChannelKind(
            "muscle_thickness",
            "mm",
            "thickness of the deep tissue, from fascia to bone along the line of travel",
            _ULTRASOUND,
            0.002,
        ),
        *(_rise(side, beside) for side in ("left", "right") for beside in (25, 40)),
    )
}
"""Every kind by its name."""


@dataclass(frozen=True, eq=False)
class RecordedChannel:
    """What one channel read in a trial.

    Parameters
    ----------
    name : str
        Of its kind in `CHANNELS`.
    time : (k,) array
        s, on the recording's clock, increasing; read-only.
    values : (k,) array
        In the kind's unit; read-only.
    accuracy : ChannelAccuracy
        Of the instrument.
    source : Path, optional
        File of its own; a column of the recording without it.
    """

    name: str
    time: FloatArray
    values: FloatArray
    accuracy: ChannelAccuracy
    source: Path | None = None

    def __post_init__(self) -> None:
        """Keep read-only copies; raise ValueError if the arrays' shapes differ."""
        for field in ("time", "values"):
            object.__setattr__(self, field, frozen_array(getattr(self, field)))
        if not (self.time.ndim == 1 and self.time.shape == self.values.shape):
            raise ValueError("time and values must be (k,) arrays of one length")

    @property
    def kind(self) -> ChannelKind:
        """What it is."""
        return CHANNELS[self.name]
