"""A study on MPI: `mpiexec -n 9 python -m mpi4py.futures python/examples/mpi.py` has eight workers."""

from __future__ import annotations

from mpi4py.futures import MPIPoolExecutor

import elastocal as ec

if __name__ == "__main__":
    scenario = ec.Scenario.load(ec.SHARED / "scenarios/klimchik2012.toml")
    with MPIPoolExecutor() as executor:
        print(scenario.study(trials=100_000, executor=executor, shards=16).text)
