"""What goes wrong, in Python's words."""

from __future__ import annotations

import difflib
import os
import re
import tempfile
from collections.abc import Iterable
from pathlib import Path


class ElastocalError(Exception):
    """What the command line says after ``error CODE:``; ``hint`` is what it says after ``hint:``, if anything.

    ``code`` is stable, such as "E0101", and ``elastocal explain`` says what it means; None for usage.
    """

    def __init__(self, message: str, hint: str | None = None, code: str | None = None) -> None:
        super().__init__(message)
        self.hint = hint
        self.code = code
        # Tracebacks show notes (from Python 3.11 on), and so the hint.
        if hint is not None and hasattr(self, "add_note"):
            self.add_note(f"hint: {hint}")


class UsageError(ElastocalError, ValueError):
    """An option that is not there, or a value that it cannot have."""


def write_whole(path: str | os.PathLike[str], text: str, suffixes: tuple[str, ...]) -> None:
    """Writes a file whole or not at all, and over none of another kind."""
    path = Path(path)
    if path.exists() and path.suffix.lower() not in suffixes:
        raise UsageError(f"{path} is there and no {' or '.join(suffixes)} file", "save under another name")
    file = None
    try:
        with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=path.resolve().parent, delete=False) as file:
            file.write(text)
        os.chmod(file.name, path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_umask())
        os.replace(file.name, path.resolve())
    except OSError as error:
        if file is not None:
            os.unlink(file.name)
        raise ElastocalError(f"{path}: cannot be written: {error.strerror}") from error


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


#: What the command line says, and Python.
WORDS = {
    "invalid digit found in string": "a whole number from 0 on is wanted",
    "invalid float literal": "a number is wanted",
    "give the path of a scenario file after the command": "the shipped ones are in ec.SHARED / 'scenarios'",
}


def nearest(word: str, known: Iterable[str]) -> str | None:
    """A hint with the known words that are like a wrong one, if there are any."""
    near = difflib.get_close_matches(word, list(known), n=3, cutoff=0.7)
    return f"did you mean {' or '.join(repr(each) for each in near)}?" if near else None


def in_python(text: str, longs: dict[str, str]) -> str:
    """A message of the command line with keywords in place of options, and without what is for a terminal."""
    told = re.split(r"\n\n(?:Usage|For more information)", text.removeprefix("error: "))[0]

    for theirs, ours in WORDS.items():
        told = told.replace(theirs, ours)
    told = re.sub(r"\S+ is not in (\d+)\.\.=(\d+)", r"\1 to \2 is allowed", told)

    def keyword(found: re.Match[str]) -> str:
        return longs.get(found[1], found[0])

    # Whole commands stay as they are typed.
    parts = re.split(r"(`[^`]*`)", told)
    return "".join(part if part.startswith("`") else re.sub(r"--([a-z][a-z-]*)(?:[ =]<[^>]*>)?", keyword, part) for part in parts).rstrip()
