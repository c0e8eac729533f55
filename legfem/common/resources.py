"""What comes with legfem: folders of subjects, and tables of values as TOML files."""

import tomllib
from pathlib import Path

from pydantic import TypeAdapter

RESOURCES = Path(__file__).resolve().parents[1] / "resources"
"""What comes with legfem and runs need: subjects, tables of the correction, factors."""


def resource[Table](name: str, schema: type[Table]) -> Table:
    """Return a table of values.

    Parameters
    ----------
    name
        Its file's within `RESOURCES`, without the ending.
    schema
        What its values are: types of Python, dataclasses.
    """
    text = (RESOURCES / f"{name}.toml").read_text(encoding="utf-8")
    return TypeAdapter(schema).validate_python(tomllib.loads(text))
