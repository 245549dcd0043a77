"""Commands with the options of the command line, as keywords."""

from __future__ import annotations

import json
from functools import lru_cache
from os import fspath
from pathlib import Path
from typing import Any

from . import _elastocal
from ._data import Condition, ElastocalError, Results, UsageError

#: Options that a program has and a function does not: results come back, and threads are the pool's.
OPTIONS_OF_THE_PROGRAM_ALONE = {"json", "quiet", "threads", "help", "version"}


@lru_cache(maxsize=1)
def options() -> dict[str, list[dict[str, Any]]]:
    """The command line's commands, each with its options."""
    found: dict[str, list[dict[str, Any]]] = json.loads(_elastocal.options())
    return found


def command(name: str, *positional: object, threads: int | None = None, **given: object) -> Results:
    """Does what ``elastocal NAME`` does, with its options as keywords: ``--plan-out FILE`` is ``plan_out=FILE``.

    Flags are ``True``; ``None`` and ``False`` leave an option out; a list gives several values. Raises
    :class:`UsageError` for what the command does not take, and :class:`ElastocalError` with the command line's message
    where it fails. ctrl-C ends what is under way.
    """
    known = {each["name"]: each for each in options().get(name, [])}
    words = [name, *(_word(each) for each in positional)]
    for keyword, value in given.items():
        option = known.get(keyword)
        if option is None or option["is_positional"]:
            raise UsageError(f"{name} has no option {keyword!r}; it has: {', '.join(sorted(known))}")
        if value is None or value is False:
            continue
        values = value if isinstance(value, (list, tuple)) else [value]
        for each in values:
            words.append(f"--{option['long']}" + (f"={_word(each)}" if option["takes_value"] else ""))
    if "quiet" in known:
        words.append("--quiet")
    return _answer(_elastocal.command(words, threads))


def _word(value: object) -> str:
    if isinstance(value, float):
        return repr(value)
    return str(value) if isinstance(value, (str, int)) else str(fspath(value))  # type: ignore[call-overload]


def _answer(text: str) -> Results:
    answer = json.loads(text)
    if "error" in answer:
        kind = UsageError if answer["is_usage"] else ElastocalError
        raise kind(answer["error"], answer["hint"], answer.get("code"))
    conditions = [Condition(**each) for each in answer["conditions"]]
    return Results(answer["results"] or {}, answer["text"], conditions)


def read(path: Path) -> str:
    """A file's text."""
    return path.read_text(encoding="utf-8")
