"""Studies on other processes and machines: each shard is a task of an executor, and the tallies are joined here."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ._commands import _command as command
from ._data import FilePath
from ._elastocal import PlanningProblem
from ._errors import ElastocalError, UsageError
from ._progress import Listener, progress
from ._results import Results

#: So often in a row workers may be lost without a shard made: what is left may be what ends them.
ATTEMPTS = 3
#: Options of a study that belong to the whole and not to a shard.
OF_THE_WHOLE = {"shard", "tally_out", "resume", "rerun"}

#: An executor, or what makes one: then another takes the place of one that broke down.
Executors = Executor | Callable[[], Executor]


@dataclass(frozen=True)
class Shards:
    """A study in shards, with all files that it reads, so that workers need no common file system."""

    scenario: str
    #: The files' bytes by their path from the folder that all are in.
    files: dict[str, bytes]
    given: dict[str, Any]
    count: int

    @classmethod
    def of(cls, scenario: FilePath, given: dict[str, Any], count: int) -> Shards:
        """Of a scenario file and the options of `study`; options that name files send them along."""
        named = {key: os.path.abspath(value) for key, value in given.items() if _is_file(value)}
        read = [os.path.abspath(path) for path in PlanningProblem(str(scenario), False).files()]
        root = os.path.commonpath([os.path.dirname(path) for path in (*read, *named.values())])
        sent = {path: os.path.relpath(path, root) for path in (*read, *named.values())}
        return cls(
            sent[read[0]],
            {short: Path(path).read_bytes() for path, short in sent.items()},
            given | {key: _Sent(sent[path]) for key, path in named.items()},
            count,
        )

    def make(self, shard: int) -> bytes:
        """Makes a shard, 1 to `count`, wherever this runs; returns its tally."""
        with tempfile.TemporaryDirectory(prefix="elastocal-") as name:
            folder = Path(name)
            for short, content in self.files.items():
                path = folder / "files" / short
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
            given: dict[str, Any] = {
                key: folder / "files" / value if isinstance(value, _Sent) else value for key, value in self.given.items()
            }
            tally = folder / "tally.json"
            scenario = folder / "files" / self.scenario
            command("study", scenario, shard=f"{shard}/{self.count}", tally_out=tally, out=folder, **given)
            return tally.read_bytes()


class _Sent(str):
    """A file that is sent along."""


def _is_file(value: object) -> bool:
    return isinstance(value, (str, os.PathLike)) and os.path.isfile(value)


def study(scenario: FilePath, executors: Executors, shards: int, tallies: Path, given: dict[str, Any]) -> list[Path]:
    """Makes the shards that are not in the folder ``tallies``, and returns the tallies' files."""
    if wrong := OF_THE_WHOLE & given.keys():
        raise UsageError(f"{sorted(wrong)[0]} is not for studies on an executor, which are made in shards")
    work = Shards.of(scenario, given, shards)
    tallies.mkdir(parents=True, exist_ok=True)
    files = {shard: tallies / f"{shard}_of_{shards}.json" for shard in range(1, shards + 1)}
    missing = {shard for shard, path in files.items() if not path.exists()}
    own: Executor | None = None
    in_vain = 0
    try:
        while missing:
            if isinstance(executors, Executor):
                executor = executors
            else:
                if own is not None:
                    own.shutdown(wait=False, cancel_futures=True)
                executor = own = executors()
            before = len(missing)
            with progress() as listener:
                broken = _make(executor, work, files, missing, listener)
            in_vain = in_vain + 1 if len(missing) == before else 0
            is_final = isinstance(executors, Executor) and isinstance(broken, BrokenExecutor)
            if broken is not None and (is_final or in_vain >= ATTEMPTS):
                raise _given_up(len(files) - len(missing), len(files), broken) from broken
    finally:
        if own is not None:
            own.shutdown(cancel_futures=True)
    return list(files.values())


def _make(
    executor: Executor, work: Shards, files: dict[int, Path], missing: set[int], listener: Listener | None
) -> Exception | None:
    """Makes each missing shard once; those that are there then are missing no more. Returns what took one, if anything."""
    broken: Exception | None = None
    futures: dict[Future[bytes], int] = {}
    try:
        for shard in sorted(missing):
            futures[executor.submit(work.make, shard)] = shard
    except BrokenExecutor as error:
        broken = error
    try:
        for future in as_completed(futures):
            shard = futures[future]
            try:
                tally = future.result()
            except ElastocalError:
                raise
            # Whatever else takes a worker away has a name of its own in every kind of executor.
            except Exception as error:
                broken = error
                continue
            # Whole or not there, whatever ends this process.
            unfinished = files[shard].with_suffix(".unfinished")
            unfinished.write_bytes(tally)
            unfinished.replace(files[shard])
            missing.discard(shard)
            if listener is not None:
                listener("shards of the study", len(files) - len(missing), len(files), "")
    finally:
        for future in futures:
            future.cancel()
    return broken


def _given_up(made: int, count: int, reason: Exception) -> ElastocalError:
    return ElastocalError(
        f"{made} of {count} shards are made, then the executor broke down: {type(reason).__name__}: {reason}",
        "with tallies=FOLDER the same call goes on from the shards that are made; give an executor that works, or a function "
        "that makes one, which is called again where one breaks down",
    )


def merged(files: list[Path], out: FilePath) -> Results:
    """The tallies of all shards as one study."""
    return command("merge", *files, out=out)
