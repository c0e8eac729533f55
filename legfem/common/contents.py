"""What stands for the content of files, wherever they lie."""

import hashlib
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Contents:
    """Stands for what is in a file, or in all files of a folder, wherever that lies."""

    path: Path

    def digest(self) -> list[list[str]]:
        """Return names and hashes of the files; a missing one has none."""
        files = [self.path] if self.path.is_file() else sorted(self.path.rglob("*"))
        return [
            [file.relative_to(self.path).as_posix(), hashlib.sha256(file.read_bytes()).hexdigest()]
            for file in files
            if file.is_file()
        ]
