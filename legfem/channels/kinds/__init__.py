"""All kinds of channel: one file each in this folder, and those of other packages.

Another package gives kinds under the entry point group "legfem.channels": each entry is a subclass of `ChannelFile`
(or a function that returns one).
"""

import sys
from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import Any

from legfem.channels import Sight
from legfem.channels.kind import ChannelFile, ChannelKind, ChannelPlan, FramesFile
from legfem.common.registry import registered
from legfem.geometry.indenter import Site

GROUP = "legfem.channels"
_FILES: tuple[ChannelFile, ...] = tuple(registered(sys.modules[__name__], ChannelFile, GROUP))

CHANNELS: Mapping[str, ChannelKind] = MappingProxyType({kind.name: kind for file in _FILES for kind in file.kinds})
"""Every kind by its name."""
FILE_OF: Mapping[str, ChannelFile] = MappingProxyType({kind.name: file for file in _FILES for kind in file.kinds})
"""By a kind's name what reads it."""
OF_FRAMES: Mapping[str, FramesFile[Any]] = MappingProxyType(
    {file.entry: file for file in _FILES if isinstance(file, FramesFile)}
)
"""By an entry of ``[channels]`` what reads its file of frames."""
IN_COLUMNS = tuple(kind for kind in CHANNELS.values() if kind.name not in OF_FRAMES)
"""Kinds that have one reading a time, which a column of a recording may hold."""
OF_LEGS = tuple(kind for kind in CHANNELS.values() if kind.models & {"2d", "3d"})
"""Kinds that a leg's models give."""
UNITS = tuple(dict.fromkeys(kind.unit for kind in OF_LEGS))
"""That a leg's channels are in."""


def files_of(model: str) -> tuple[ChannelFile, ...]:
    """Return what reads the channels that a model gives, ``2d`` or ``3d``."""
    return tuple(file for file in _FILES if any(model in kind.models for kind in file.kinds))


def plans(site: Site) -> list[ChannelPlan]:
    """Return the ways to record channels at a site that a plan may recommend."""
    return [plan for file in _FILES for plan in file.plans(site)]


def planned_sights(site: Site, recorded: Collection[str]) -> tuple[Sight, ...]:
    """Return where plans would have kinds seen that have places, but those that are recorded."""
    found = {one.name: one for plan in plans(site) for one in plan.channels if one.places}
    return tuple(one for name, one in found.items() if name not in recorded)
