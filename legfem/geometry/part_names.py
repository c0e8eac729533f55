"""What the parts of a segmented limb are, by the names that people and segmenters give them."""

import difflib
import re
from collections.abc import Iterable
from itertools import chain
from pathlib import Path

from legfem.common.errors import InputError
from legfem.common.resources import resource
from legfem.geometry.contours import MUSCLE_HULL
from legfem.geometry.section import LIMBS

BONE = "bone"
"""Of a calf: its two, without their names."""
_BONES = tuple(chain(*LIMBS.values()))
_PARTS = {name: part for part, names in resource("segmented", dict[str, tuple[str, ...]]).items() for name in names}
_PARTS |= dict(zip(_BONES, _BONES, strict=True))
_SIDE = re.compile(r"^(left|right)_|_(left|right)$")


def plain_name(name: str) -> str:
    """Return a part's name in small letters, with underscores and without its side."""
    return _SIDE.sub("", re.sub(r"\W+", "_", name.strip().lower()))


def part_named(name: str, source: str | Path) -> str:
    """Return which part something is: ``skin``, ``muscle_hull``, a bone's name, or ``bone`` for a calf's two.

    Parameters
    ----------
    name : str
        One of ``segmented.toml`` or ``bones.toml``, in capitals or small letters, with a side or without;
        or any after ``bone_`` or ``muscle_``.
    source : str or Path
        What errors name as the file.

    Raises
    ------
    InputError
        If nothing says what it is.
    """
    plain = plain_name(name)
    if plain in _PARTS:
        return _PARTS[plain]
    kind, _, own = plain.partition("_")
    if own and kind == "muscle":
        return MUSCLE_HULL
    if own and kind == BONE and own not in ("skin", "fascia") and _PARTS.get(own) != MUSCLE_HULL:
        return own
    near = difflib.get_close_matches(plain, _PARTS, n=1)
    remedy = f"did you mean '{near[0]}'?" if near else f"call it bone_{plain} or muscle_{plain}, whichever it is"
    raise InputError(source, name, "is no part of a limb that has a name here", remedy)


def muscle_named(name: str, given: Iterable[str], source: str | Path) -> str:
    """Return what the muscle of a plain name is called among the parts that are given.

    Raises
    ------
    InputError
        If none of them is it.
    """
    muscles = {plain_name(part): part for part in given if part_named(part, source) == MUSCLE_HULL}
    if name not in muscles:
        raise InputError(source, name, "is no muscle here", f"give one of {', '.join(muscles)}")
    return muscles[name]


def bones_of(parts: Iterable[str]) -> list[str]:
    """Return the bones among parts, each once: those of a limb in its order, others after them."""
    bones = dict.fromkeys(part for part in parts if part not in ("skin", MUSCLE_HULL))
    return sorted(bones, key=lambda bone: _BONES.index(bone) if bone in _BONES else len(_BONES))
