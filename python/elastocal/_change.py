"""Scenarios that are changed in Python: another file, in a folder that goes with the scenario."""

from __future__ import annotations

import difflib
import json
import reprlib
import tempfile
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from . import _elastocal
from ._commands import command, read
from ._errors import UsageError

Path_ = tuple[str, ...]


@lru_cache(maxsize=1)
def keys() -> frozenset[Path_]:
    """All keys of scenario files, such as ("instrument", "sigma_mm"); "[]" stands for the number of a table in a list."""
    schema = command("schema")

    def walk(node: dict[str, Any], path: Path_) -> Iterator[Path_]:
        if "$ref" in node:
            node = schema["$defs"][node["$ref"].rsplit("/", 1)[-1]]
        for kind in ("anyOf", "oneOf", "allOf"):
            for each in node.get(kind, []):
                yield from walk(each, path)
        if isinstance(node.get("items"), dict):
            yield from walk(node["items"], (*path, "[]"))
        for name, each in node.get("properties", {}).items():
            yield (*path, name)
            yield from walk(each, (*path, name))

    return frozenset(walk(schema, ()))


def dotted(path: Path_) -> str:
    """A key as it is written."""
    return ".".join(path)


def found(key: str) -> Path_:
    """Where a key is: dotted it stands for itself, and a name alone for the one key of that name that is least deep."""
    path = tuple(str(key).split("."))
    if tuple("[]" if each.isdigit() else each for each in path) in keys():
        return path
    own = sorted((each for each in keys() if "[]" not in each), key=lambda each: (len(each), each))
    named = [each for each in own if each[-1] == key]
    least = [each for each in named if len(each) == len(named[0])]
    if len(least) == 1:
        return least[0]
    if least:
        several = " or ".join(dotted(each) for each in least)
        raise UsageError(f"{key!r} is a key of several tables: {several}", f"with_(**{{'{dotted(least[0])}': ...}}) says which")
    near = difflib.get_close_matches(path[-1], {each[-1] for each in own}, n=2)
    places = [dotted(each) for each in own if each[-1] in near and each[:-1] == path[:-1]] or [
        dotted(each) for name in near for each in own if each[-1] == name
    ]
    hint = f"did you mean {' or '.join(repr(each) for each in places[:3])}?" if places else None
    raise UsageError(f"scenarios have no key {key!r}", hint)


def put(table: Any, path: Path_, value: Any, key: str) -> None:
    """Sets a key of nested tables; None takes it out, and a table of keys changes these alone."""
    for each in path[:-1]:
        if isinstance(table, list):
            if int(each) >= len(table):
                raise UsageError(f"{key}: the scenario has {len(table)} of them, counted from 0")
            table = table[int(each)]
        else:
            table = table.setdefault(each, {})
    name: Any = int(path[-1]) if isinstance(table, list) else path[-1]
    if value is None and isinstance(table, dict):
        table.pop(name, None)
    elif isinstance(value, Mapping) and isinstance(table.get(name), dict):
        table[name] |= value
    else:
        table[name] = value


def _plain(value: Any) -> Any:
    """Arrays and NumPy's numbers as TOML has them, and paths as text."""
    return value.tolist() if hasattr(value, "tolist") else str(value)


def _with_files(value: Any, folder: Path) -> Any:
    """The same with the whole paths of files that are named."""
    if isinstance(value, dict):
        return {key: _with_files(each, folder) for key, each in value.items()}
    if isinstance(value, list):
        return [_with_files(each, folder) for each in value]
    is_file = isinstance(value, str) and ("." in value or "/" in value) and (folder / value).is_file()
    return str((folder / value).resolve()) if is_file else value


def table(path: Path) -> dict[str, Any]:
    """What a scenario file says."""
    read_table: dict[str, Any] = json.loads(_elastocal.read_toml(read(path)))
    return read_table


def changed(path: Path, changes: Mapping[str, Any]) -> tuple[tempfile.TemporaryDirectory[str], Path]:
    """A scenario file with other values, in a folder of its own."""
    said = _with_files(table(path), path.parent)
    for key, value in changes.items():
        place = found(key)
        try:
            _written({} if value is None else {key: value})
        except (TypeError, ValueError):
            allowed = "finite numbers, text that UTF-8 has, truth values, and lists and tables of them are allowed"
            raise UsageError(f"{dotted(place)}: found {reprlib.repr(value)}; {allowed}") from None
        put(said, place, value, key)
    return in_folder(path.name, _written(said))


def _written(said: dict[str, Any]) -> str:
    return _elastocal.written_toml(json.dumps(said, default=_plain, allow_nan=False))


def in_folder(name: str, text: str) -> tuple[tempfile.TemporaryDirectory[str], Path]:
    """A file in a folder of its own, which goes when nobody holds it."""
    folder = tempfile.TemporaryDirectory(prefix="elastocal-")
    path = Path(folder.name) / name
    path.write_text(text, encoding="utf-8")
    return folder, path
