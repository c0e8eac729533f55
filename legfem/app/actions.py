"""What can be run on a folder, and the command that does it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from legfem.common.errors import InputError


@dataclass(frozen=True)
class Choice:
    """An option that the app asks for by itself.

    Parameters
    ----------
    option : str
        As the command knows it.
    label : str
        As people read it, with the unit.
    choices : sequence of str
        What it may be; empty for a number.
    """

    option: str
    label: str
    choices: Sequence[str] = ()


@dataclass(frozen=True)
class Action:
    """A command on one kind of folder.

    Parameters
    ----------
    name : str
        Of the command.
    folder : str
        The option that takes the folder.
    does : str
        In a sentence.
    choices : sequence of Choice
        Asked for.
    """

    name: str
    folder: str
    does: str
    choices: Sequence[Choice] = ()

    @property
    def module(self) -> str:
        """What ``python -m`` starts."""
        return f"legfem.{self.name}"

    def options(self, folder: Path, out: Path, chosen: Mapping[str, str], more: str = "") -> list[str]:
        """Return the command's options.

        Parameters
        ----------
        folder, out : Path
            What is looked at, and where the results go.
        chosen : mapping
            Values by option; an empty one leaves it at its default.
        more : str
            Other options, as people type them.

        Raises
        ------
        InputError
            If ``more`` can't be taken apart, or names what the app itself gives.
        """
        try:
            typed = shlex.split(more)
        except ValueError as error:
            raise InputError("options", more, str(error).lower(), "close the quotes") from None
        for word in typed:
            if word.partition("=")[0] in (self.folder, "--out", "--subject", "--json", "--quiet"):
                raise InputError("options", word, "is given by the app", "leave it out")
        stated = [part for option, value in chosen.items() if value for part in (option, value)]
        return [self.folder, str(folder), "--out", str(out), *stated, *typed]


_DEPTH = Choice("--depth", "use recordings down to (mm)")
_LEG = (
    Action(
        "identify",
        "--subject-dir",
        "Find C10 and C20 of the muscle, with intervals.",
        (
            Choice("--law", "law", ("both", "neo-hookean", "reduced-polynomial")),
            _DEPTH,
            Choice("--model", "model", ("2d", "3d")),
        ),
    ),
    Action(
        "diagnose",
        "--subject-dir",
        "Say whether the model describes the recordings, and which physics is missing if not. "
        "The first of a leg takes long.",
    ),
    Action(
        "plan",
        "--subject-dir",
        "Say which tests of this leg would show which effects, before any is made.",
        (
            Choice("--c10", "expected C10 (kPa)"),
            Choice("--c20", "expected C20 (kPa)"),
            Choice("--depth", "to press to (mm)"),
            Choice("--rate", "rate (mm/s)"),
        ),
    ),
)
ACTIONS: Mapping[str, Sequence[Action]] = {
    "subject.toml": _LEG,
    "leg.toml": (
        Action(
            "stocking",
            "--subject-dir",
            "Find the stiffness of fat and muscle, and the pressures in the leg.",
            (Choice("--cells", "about how many tetrahedra"),),
        ),
    ),
    "specimen.toml": (
        Action(
            "identify",
            "--specimen-dir",
            "Fit one law to all recordings together.",
            (Choice("--law", "law", ("neo-hookean", "reduced-polynomial", "yeoh", "exponential")),),
        ),
        Action(
            "diagnose",
            "--specimen-dir",
            "Say of each specimen whether the model describes its recordings, and which physics is missing if not.",
            (Choice("--specimen", "one specimen alone (its name)"),),
        ),
    ),
}
"""By the file that says what a folder is."""
