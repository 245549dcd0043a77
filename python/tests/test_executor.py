"""Studies on executors: the command line's bits, whatever becomes of the workers."""

from __future__ import annotations

import multiprocessing
import os
import signal
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

import elastocal as ec
from elastocal import _executor

from test_elastocal import PAPER, QUICK, program, same

SPAWN = multiprocessing.get_context("spawn")


def pool(workers: int = 2) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(workers, mp_context=SPAWN)


class Counting(ThreadPoolExecutor):
    """Counts what it is given."""

    given = 0

    def submit(self, *words: Any, **more: Any) -> Future[Any]:
        self.given += 1
        return super().submit(*words, **more)


class Killing(ProcessPoolExecutor):
    """Kills one of its workers at the third shard."""

    given = 0

    def submit(self, *words: Any, **more: Any) -> Future[Any]:
        self.given += 1
        if self.given == 3:
            super().submit(int).result()
            os.kill(next(iter(self._processes)), signal.SIGKILL)
        return super().submit(*words, **more)


@pytest.mark.parametrize("given", [{"trials": 3000}, {"trials": 40, "level": "robot", "seed": 7}])
def test_a_process_pool_has_the_program_s_bits(tmp_path: Path, given: dict[str, Any]) -> None:
    words = [word for key, value in given.items() for word in (f"--{key}", value)]
    expected = program("study", PAPER, *words, "--out", tmp_path)
    with pool() as executor:
        found = ec.Scenario(PAPER).study(executor=executor, shards=5, **given)
    assert same(expected, found)


def test_a_killed_worker_costs_no_bit(tmp_path: Path) -> None:
    scenario = ec.Scenario(QUICK)
    expected = scenario.study(trials=3000)
    # An executor that is broken is broken for good: what is made stays, and another goes on from there.
    with Killing(1, mp_context=SPAWN) as executor, pytest.raises(ec.ElastocalError, match="executor broke down") as raised:
        scenario.study(trials=3000, executor=executor, shards=6, tallies=tmp_path)
    assert raised.value.hint is not None and "tallies" in raised.value.hint
    made = len(list(tmp_path.glob("*.json")))
    with Counting(1) as executor:
        assert same(expected, scenario.study(trials=3000, executor=executor, shards=6, tallies=tmp_path))
        assert executor.given == 6 - made
    # What makes executors is asked for another one.
    makers: list[Executor] = [Killing(1, mp_context=SPAWN), pool()]
    assert same(expected, scenario.study(trials=3000, executor=lambda: makers.pop(0), shards=6))
    assert not makers


def test_what_ends_every_worker_is_given_up() -> None:
    class Useless(ThreadPoolExecutor):
        def submit(self, *words: Any, **more: Any) -> Future[Any]:
            return super().submit(int, "no number")

    with Useless(1) as executor, pytest.raises(ec.ElastocalError, match="0 of 3 shards are made") as raised:
        ec.Scenario(QUICK).study(trials=100, executor=executor, shards=3)
    assert isinstance(raised.value.__cause__, ValueError)


def test_workers_need_no_file_of_this_machine(tmp_path: Path) -> None:
    folder = tmp_path / "here"
    text = QUICK.read_text(encoding="utf-8")
    (folder / "scenarios").mkdir(parents=True)
    (folder / "models").mkdir()
    (folder / "scenarios/planar_3r.toml").write_text(text, encoding="utf-8")
    model = QUICK.parents[1] / "models/planar_3r.xml"
    (folder / "models/planar_3r.xml").write_bytes(model.read_bytes())
    expected = ec.Scenario(QUICK).study(trials=500)

    class Elsewhere(ThreadPoolExecutor):
        def submit(self, *words: Any, **more: Any) -> Future[Any]:
            if folder.exists():
                folder.rename(tmp_path / "moved")
            return super().submit(*words, **more)

    with Elsewhere(1) as executor:
        found = ec.Scenario(folder / "scenarios/planar_3r.toml").study(trials=500, executor=executor, shards=2)
    assert same(expected, found)


def test_errors_and_wrong_options_are_told_once() -> None:
    with ThreadPoolExecutor(1) as executor:
        with pytest.raises(ec.UsageError, match="no option 'trails'"):
            ec.Scenario(QUICK).study(trails=100, executor=executor)
        with pytest.raises(ec.UsageError, match="resume is not for studies on an executor"):
            ec.Scenario(QUICK).study(executor=executor, resume="tally.json")
        with pytest.raises(ec.UsageError, match="on an executor"):
            ec.Scenario(QUICK).study(shards=4)
    assert _executor.ATTEMPTS > 1


def test_dask_has_the_program_s_bits_and_outlives_a_worker() -> None:
    distributed = pytest.importorskip("distributed", reason="Dask is not installed")
    expected = ec.Scenario(QUICK).study(trials=2000)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster, distributed.Client(cluster) as client:
        executor = client.get_executor(pure=False)
        assert same(expected, ec.Scenario(QUICK).study(trials=2000, executor=executor, shards=4))
        victim = next(iter(cluster.workers.values())).pid
        os.kill(victim, signal.SIGKILL)
        assert same(expected, ec.Scenario(QUICK).study(trials=2000, executor=executor, shards=4))
