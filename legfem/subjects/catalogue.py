"""Folders of subjects: those that come with legfem, by name, and the user's own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from legfem.common.errors import InputError

RESOURCES = Path(__file__).resolve().parents[1] / "resources"
"""What comes with legfem and runs need: subjects, tables of the correction, factors."""


@dataclass(frozen=True)
class Catalogue:
    """Subjects of one kind that come with legfem.

    Parameters
    ----------
    folder : Path
        That holds a folder for each.
    file : str
        That every subject's folder holds.
    """

    folder: Path
    file: str

    @property
    def names(self) -> tuple[str, ...]:
        """Of the subjects."""
        return tuple(sorted(path.parent.name for path in self.folder.glob(f"*/{self.file}")))

    def find(self, name: str) -> Path:
        """Return a subject's folder.

        Raises
        ------
        InputError
            If there is none of that name; lists those there are.
        """
        if name in self.names:
            return self.folder / name
        known = ", ".join(self.names)
        there = f"known subjects are {known}" if known else f"none are in {self.folder}"
        raise InputError(
            "--subject", name, "unknown subject", f"{there}; for a folder of your own give --subject-dir PATH"
        )

    def named(self, subject: str | None, subject_dir: Path | None) -> Path:
        """Return the folder that a command's --subject or --subject-dir names.

        Raises
        ------
        InputError
            If both or none are given, or the subject isn't known.
        """
        if subject is not None and subject_dir is not None:
            raise InputError("--subject", subject, "--subject-dir is given too", "give one of them")
        if subject_dir is not None:
            return subject_dir
        if subject is None:
            raise InputError("--subject", "missing", "no subject is given", "give --subject ID or --subject-dir PATH")
        return self.find(subject)

    def opened(self, directory: Path) -> Path:
        """Return the subject's file in a folder.

        Raises
        ------
        InputError
            If there is no such folder.
        """
        if not directory.is_dir():
            raise InputError(directory, "subject folder", "not found", f"give a folder that holds {self.file}")
        return directory / self.file
