"""Commands with the options of the command line, as keywords."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable, Sequence
from functools import lru_cache
from operator import index
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from . import _elastocal
from ._errors import ElastocalError, UsageError, in_python, nearest
from ._progress import progress
from ._results import Condition, Results

if TYPE_CHECKING:
    from ._options import Commands

Function = TypeVar("Function", bound=Callable[..., Any])

#: Options that a program has and a function does not: results come back, and threads are the pool's.
OPTIONS_OF_THE_PROGRAM_ALONE = {"json", "quiet", "threads", "help", "version"}
#: The command line's.
MOST_THREADS = 65535
#: What a function of a command takes by name, beside the options that its signature has from the command.
NAMED: dict[str, set[str]] = {}
#: Types of values that say more than a number.
TYPES = {"prove": "float | str", "prove_time": "float | str"}


@lru_cache(maxsize=1)
def options() -> dict[str, list[dict[str, Any]]]:
    """The command line's commands, each with its options."""
    found: dict[str, list[dict[str, Any]]] = json.loads(_elastocal.options())
    return found


def keywords(name: str) -> dict[str, dict[str, Any]]:
    """The options of a command that are keywords of its function."""
    return {
        each["name"]: each
        for each in options()[name]
        if not (each["is_positional"] or each["is_hidden"] or each["name"] in OPTIONS_OF_THE_PROGRAM_ALONE)
    }


def annotation(option: dict[str, Any]) -> str:
    """The type of a keyword."""
    kind = TYPES.get(option["name"], "FilePath" if option["type"] == "path" else option["type"])
    if option["choices"] and kind == "str":
        kind = f"Literal[{', '.join(json.dumps(each) for each in option['choices'])}]"
    return f"{kind} | Sequence[{kind}] | None" if option["is_list"] else f"{kind} | None"


def takes(name: str) -> Callable[[Function], Function]:
    """Shows a command's options in a function's signature and documentation: what completes is what the command takes."""

    def shown(function: Function) -> Function:
        own = inspect.signature(function)
        named = [each for each in own.parameters.values() if each.kind is not inspect.Parameter.VAR_KEYWORD]
        NAMED[name] = NAMED.get(name, set()) | {each.name for each in named}
        more = {key: each for key, each in keywords(name).items() if key not in own.parameters}
        more["threads"] = {"name": "threads", "type": "int", "choices": [], "is_list": False, "help": "How many threads to use"}
        kind = inspect.Parameter.KEYWORD_ONLY
        added = [inspect.Parameter(key, kind, default=None, annotation=annotation(each)) for key, each in more.items()]
        function.__signature__ = own.replace(parameters=[*named, *added])  # type: ignore[attr-defined]
        lines = [f"    {key}: {in_python(each['help'] or '', longs())}" for key, each in more.items()]
        function.__doc__ = "\n".join([inspect.cleandoc(function.__doc__ or ""), "", f"Options of ``elastocal {name}``:", "", *lines])
        return function

    return shown


@lru_cache(maxsize=1)
def longs() -> dict[str, str]:
    """All options of the command line, and the keywords for them."""
    return {each["long"]: each["name"] for command in options().values() for each in command if each["long"]}


def _command(name: str, /, *positional: object, threads: int | None = None, **given: object) -> Results:
    """Does what ``elastocal NAME`` does, with its options as keywords: ``--plan-out FILE`` is ``plan_out=FILE``.

    Flags are ``True``; ``None`` and ``False`` leave an option out; a list gives several values. Raises
    :class:`UsageError` for what the command does not take, and :class:`ElastocalError` with the command line's message
    where it fails. ctrl-C ends what is under way.
    """
    if name not in options():
        raise UsageError(f"there is no command {name!r}", nearest(name, options()))
    known = {each["name"]: each for each in options()[name]}
    words = [name, *(_word(name, each) for each in positional)]
    for keyword, value in given.items():
        option = known.get(keyword)
        if option is None or option["is_positional"]:
            has = ", ".join(sorted(keywords(name)))
            raise UsageError(f"{name} has no option {keyword!r}; it has: {has}", nearest(keyword, keywords(name)))
        if value is None or value is False:
            continue
        if not option["takes_value"] and value is not True:
            raise UsageError(f"{keyword} is True or False, not {value!r}")
        for each in _values(keyword, option, value):
            words.append(f"--{option['long']}" + (f"={each}" if option["takes_value"] else ""))
    if "quiet" in known:
        words.append("--quiet")
    if threads is not None:
        threads = whole("threads", threads, MOST_THREADS)
    with progress() as listener:
        return _answer(_elastocal.command(words, threads, listener))


command: Commands = _command


def _values(keyword: str, option: dict[str, Any], value: object) -> list[str]:
    several = isinstance(value, Sequence) and not isinstance(value, str)
    if several and not option["is_list"]:
        raise UsageError(f"{keyword} is one value, not {value!r}")
    if value is True and option["takes_value"]:
        raise UsageError(f"{keyword} wants a value{': ' + ', '.join(option['choices']) if option['choices'] else ''}, not True")
    is_whole = option["type"] == "int"
    return [_word(keyword, each, is_whole) for each in (value if several else [value])]  # type: ignore[attr-defined]


def whole(keyword: str, value: object, most: int) -> int:
    """A whole number from 1 on, of those that are no options of a command."""
    try:
        found = 0 if isinstance(value, bool) else index(value)  # type: ignore[arg-type]
    except TypeError:
        found = 0
    if not 1 <= found <= most:
        raise UsageError(f"invalid value {value!r} for {keyword!r}: a whole number from 1 to {most} is wanted")
    return found


def _word(keyword: str, value: object, is_whole: bool = False) -> str:
    if hasattr(value, "item") and getattr(value, "size", 0) == 1:
        # NumPy's numbers are Python's.
        value = value.item()
    if isinstance(value, float):
        if is_whole and value.is_integer():
            return str(int(value))
        return repr(value)
    told = fspath(value) if isinstance(value, PathLike) else value
    if not isinstance(told, (str, int)):
        raise UsageError(f"{keyword} is text, a number or a path, not a {type(value).__name__}")
    if re.search("[\ud800-\udfff]", str(told)):
        raise UsageError(f"{keyword}: found {told!r}; text that UTF-8 has is wanted")
    return str(told)


def _answer(text: str) -> Results:
    answer = json.loads(text)
    if "error" in answer:
        kind = UsageError if answer["is_usage"] else ElastocalError
        told, _, tip = in_python(answer["error"], longs()).partition("\n\n  tip: ")
        if answer["is_usage"]:
            told = " ".join(told.split())
        hint = answer["hint"] or tip or None
        raise kind(told, None if hint is None else in_python(hint, longs()), answer.get("code"))
    conditions = [Condition(**each) for each in answer["conditions"]]
    return Results(answer["results"] or {}, answer["text"], conditions)


def read(path: Path) -> str:
    """A file's text."""
    return path.read_text(encoding="utf-8")
