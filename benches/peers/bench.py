"""Times elastocal's hot paths beside other programs that do the same work, in turn, and prints one table.

A ratio is the peer's time over elastocal's: above 1, elastocal is faster. Each is a median with its range over
the repetitions. Both sides have shown before that they come to the same numbers.
"""

import argparse
import importlib
import json
import os
import platform
import sys
import time
from importlib import metadata
from pathlib import Path

os.chdir(Path(__file__).resolve().parents[2])

from driver import Driver
from timing import Result, alternate, spread, timer

# A file beside this one, its function, and what it is for if it cannot be had.
PEERS = [
    ("objective_numpy", "rows", "objective and gradient", "NumPy"),
    ("equilibrium_mujoco", "rows", "virtual measurement", "MuJoCo's Python"),
    ("identify_scipy", "rows", "identification", "NumPy, SciPy"),
    ("study_numpy", "rows", "Monte Carlo, model level", "NumPy"),
    ("study_numpy", "robot_rows", "Monte Carlo, robot level", "MuJoCo's Python, SciPy"),
    ("write_mcap", "rows", "MCAP", "Python's mcap"),
    ("write_rerun", "rows", "rrd", "rerun's Python SDK"),
]
PARALLEL = "Monte Carlo, model level, 2 threads"
FIT = "fit of 45 parameters to 1000 poses"
MEASURED = "a robot from 2773 absolute poses"
PACKAGES = ["numpy", "scipy", "mujoco", "mcap", "rerun-sdk", "figaroh", "pyscipopt"]


def skipping(name: str, peer: str, make) -> list[Result]:
    """What `make` gives, or a row that says why there is nothing."""
    try:
        return make()
    except (ImportError, OSError) as error:
        return [Result(name, peer, skipped=str(error))]


def compared(driver: Driver, problem: dict, effort: dict, module: str, function: str) -> list[Result]:
    results = []
    for row in getattr(importlib.import_module(module), function)(problem):
        print(f"{row.name}: {row.peer}", file=sys.stderr)
        sides = [lambda times: driver.seconds(row.path, times), timer(row.work)]
        ours, peer = alternate(sides, effort["slice_s"], effort["repetitions"])
        results.append(Result(row.name, row.peer, ours, peer))
    return results


def parallel(driver: Driver, effort: dict) -> Result:
    """Both sides are elastocal: one thread beside two."""
    name, peer = PARALLEL, "elastocal on 1 thread"
    if len(os.sched_getaffinity(0)) < 2:
        return Result(name, peer, skipped="there is one core")
    paths = ["study_model_threads_2", "study_model"]
    sides = [lambda times, path=path: driver.seconds(path, times) for path in paths]
    two, one = alternate(sides, effort["slice_s"], effort["repetitions"])
    efficiency = spread([slow / quick / 2 for slow, quick in zip(one, two)])
    return Result(name, peer, two, one, note=f"parallel efficiency {efficiency['median']:.2f}")


def machine() -> dict:
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    models = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    versions = {}
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = None
    return {
        "machine": platform.machine(),
        "cpu": models[0] if models else "unknown",
        "cores": len(os.sched_getaffinity(0)),
        "python": platform.python_version(),
        "packages": versions,
        "load_average_before": os.getloadavg()[0],
    }


def amount(seconds: float) -> str:
    for unit, size in [("s", 1), ("ms", 1e-3), ("us", 1e-6)]:
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def line(result: Result) -> str:
    if result.skipped:
        cells = [result.name, "", result.peer, f"skipped: {result.skipped}", "", ""]
        return "| " + " | ".join(cells) + " |"
    ratio, ours, peer = (spread(values) for values in (result.ratios(), result.ours_s, result.peer_s))
    more = "> " if result.at_least else ""
    cells = [
        result.name,
        amount(ours["median"]),
        result.peer,
        more + amount(peer["median"]),
        f"{more}{ratio['median']:.3g} ({ratio['min']:.3g} to {ratio['max']:.3g})",
        result.note,
    ]
    return "| " + " | ".join(cells) + " |"


def record(result: Result) -> dict:
    told = {"name": result.name, "peer": result.peer}
    if result.skipped:
        return told | {"skipped": result.skipped}
    told |= {"ratio": spread(result.ratios()), "at_least": result.at_least, "note": result.note or None}
    told |= {"elastocal_s": spread(result.ours_s), "peer_s": spread(result.peer_s)}
    return told


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer and shorter repetitions")
    parser.add_argument("--only", default="", metavar="TEXT", help="only rows whose name has this in it")
    parser.add_argument("--json", type=Path, default=Path("out/bench.json"))
    arguments = parser.parse_args()
    effort = {"slice_s": 0.15, "repetitions": 9, "seeds": 3, "limit_s": 15.0, "proof_s": 60.0}
    if arguments.quick:
        effort = {"slice_s": 0.03, "repetitions": 3, "seeds": 1, "limit_s": 5.0, "proof_s": 10.0}

    begun, about = time.perf_counter(), machine()
    driver = Driver()
    problem = driver.problem()
    results = []
    for module, function, name, peer in PEERS:
        if arguments.only in name:
            make = lambda: compared(driver, problem, effort, module, function)
            results += skipping(name, peer, make)
    if arguments.only in PARALLEL:
        results.append(parallel(driver, effort))
    if arguments.only in FIT:
        print(f"{FIT}: SciPy", file=sys.stderr)
        make = lambda: [importlib.import_module("fit_scipy").fit(FIT, driver, problem, effort["seeds"])]
        results += skipping(FIT, "SciPy", make)
    driver.close()
    if arguments.only in MEASURED:
        print(f"{MEASURED}: SciPy", file=sys.stderr)
        make = lambda: importlib.import_module("fit_measured").beside_scipy(MEASURED, 1)
        results += skipping(MEASURED, "SciPy", make)
        print(f"{MEASURED}: FIGAROH", file=sys.stderr)
        make = lambda: importlib.import_module("fit_measured").beside_figaroh(MEASURED)
        results += skipping(MEASURED, "FIGAROH", make)
    print("searches", file=sys.stderr)
    searches = [
        ("search to a certified plan", "SciPy SLSQP", "beside_scipy", (effort["limit_s"], effort["seeds"])),
        ("selection from a pool", "FIGAROH", "beside_figaroh", (problem, effort["seeds"])),
        ("proof of the bound", "SCIP", "beside_scip", (effort["proof_s"],)),
    ]
    for name, peer, function, given in searches:
        if arguments.only not in name:
            continue
        results += skipping(
            name, peer, lambda: getattr(importlib.import_module("whole_searches"), function)(*given)
        )

    about |= {"load_average_after": os.getloadavg()[0], "elapsed_s": time.perf_counter() - begun}
    print(f"{about['cpu']}, {about['cores']} cores, {about['machine']}; peers on one thread, searches on all")
    loads = f"{about['load_average_before']:.1f} before and {about['load_average_after']:.1f} after"
    print(f"medians and ranges of {effort['repetitions']} repetitions in turn, {effort['seeds']} for searches; load {loads}\n")
    print("| work | elastocal | peer | its time | ratio | remark |\n|---|---:|---|---:|---:|---|")
    for result in results:
        print(line(result))
    arguments.json.parent.mkdir(parents=True, exist_ok=True)
    arguments.json.write_text(json.dumps(about | {"rows": [record(row) for row in results]}, indent=2) + "\n")
    print(f"\n{about['elapsed_s']:.0f} s; wrote {arguments.json}")


if __name__ == "__main__":
    main()
