"""What is seen of a pressed leg beside its force: kinds of channel, and how each is read off a solved state."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Sight:
    """Places at which a channel is seen, each of which has a course of its own.

    Parameters
    ----------
    name
        Name of the channel's kind.
    places
        What tells each from others, as its kind has it; none of a kind that has but one course.
    """

    name: str
    places: tuple[tuple[float, ...], ...] = ()
