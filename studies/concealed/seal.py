"""Sealing a case's key: hidden until it is scored, and provably not changed since it was made.

A key is written enciphered with a stream made from the study's seed, beside the salted hash of its
content. Whoever diagnoses has neither seed nor key; who scores gives the seed, and the hash shows
that nothing was changed.
"""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from legfem.common.documents import write_document
from legfem.common.errors import InputError


def write_sealed(path: Path, content: Mapping[str, Any], seed: int) -> None:
    """Write a key's salted hash and its enciphered content."""
    text = json.dumps(content, sort_keys=True).encode()
    salt = secrets.token_hex(16)
    write_document(
        path,
        {
            "sha256": hashlib.sha256(salt.encode() + text).hexdigest(),
            "salt": salt,
            "content": _enciphered(text, seed, salt).hex(),
        },
    )


def read_sealed(path: Path, seed: int) -> dict[str, Any]:
    """Open a key.

    Raises
    ------
    InputError
        If it isn't there, the seed is another, or its content isn't what was sealed.
    """
    try:
        sealed = json.loads(path.read_text())
        salt = sealed["salt"]
        text = _enciphered(bytes.fromhex(sealed["content"]), seed, salt)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(path, "key", f"can't be read ({error})", "make the cases again") from None
    if hashlib.sha256(salt.encode() + text).hexdigest() != sealed["sha256"]:
        raise InputError(path, "--seed", "does not open this key", "give the seed the cases were made with")
    return dict(json.loads(text))


def _enciphered(text: bytes, seed: int, salt: str) -> bytes:
    blocks = (hashlib.sha256(f"{seed}/{salt}/{k}".encode()).digest() for k in range(len(text) // 32 + 1))
    return bytes(a ^ b for a, b in zip(text, b"".join(blocks), strict=False))
