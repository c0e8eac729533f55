"""What is wrong with a call, in the words of calls: rooms name the commands' options."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from legfem.common.errors import InputError

_ARGUMENTS = {
    "--fix": "fixed",
    "--identify": "parameters",
    "--leave-out": "leave_out",
    "--no-emulator": "settings.emulator",
    "--prior": "parameters",
    "--seed": "settings.seed",
    "--weighting": "settings.weighting",
}
_REMEDIES = (
    (r"python -m legfem\.(identify|diagnose) --model 3d", r'lf.\1(leg, model="3d")'),
    (r"python -m legfem\.(identify|diagnose)\b", r"lf.\1(folder)"),
    (r"--(site|model) ([\w.-]+)", r'\1="\2"'),
    (r"add --identify ([\w.]+), or --fix '[^']*'", r"put \1 into parameters or fixed"),
    (r"--prior\b", "a prior"),
    (r"--(site|model|correction)\b", r"\1="),
)


@contextmanager
def in_calls_words() -> Iterator[None]:
    """Name a call's arguments where an InputError names a command's options."""
    try:
        yield
    except InputError as error:
        source, field = _argument(error.source), _argument(error.field)
        remedy = error.remedy
        for option, argument in _REMEDIES:
            remedy = re.sub(option, argument, remedy)
        if (source, field, remedy) == (error.source, error.field, error.remedy):
            raise
        raise InputError(source, field, error.problem, remedy) from None


def _argument(text: str) -> str:
    """Return the argument of an option; what isn't one as it is."""
    if not text.startswith("--"):
        return text
    return _ARGUMENTS.get(text, text.removeprefix("--").replace("-", "_"))
