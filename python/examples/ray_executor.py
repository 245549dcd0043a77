"""A study on Ray: `pip install ray`, then this script; `ray.init(ADDRESS)` takes a cluster."""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

import ray

import elastocal as ec


class RayExecutor(Executor):
    """Ray's tasks as an executor; a task whose worker is lost is made again by Ray."""

    def __init__(self) -> None:
        self._call = ray.remote(max_retries=3)(lambda work, words, more: work(*words, **more))

    def submit(self, work: Callable[..., Any], /, *words: Any, **more: Any) -> Future[Any]:
        future: Future[Any] = self._call.remote(work, words, more).future()
        return future


if __name__ == "__main__":
    ray.init(*sys.argv[1:2])
    scenario = ec.Scenario.load(ec.SHARED / "scenarios/klimchik2012.toml")
    print(scenario.study(trials=100_000, executor=RayExecutor(), shards=16).text)
