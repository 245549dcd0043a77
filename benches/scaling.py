#!/usr/bin/env python3
"""How elastocal's costs grow with measurements, joints, runs and threads: tables, a picture, and a check.

All but threads are instruction counts, so the growth can be judged on a busy machine.
"""

import json
import math
import os
import statistics
import sys

from counting import ROOT, Counter, Missing, where
from peers.driver import Driver
from scaling_plot import picture

# What grows: a title, the sizes, the driver's path for a size, its repetitions, and the growth: "linear",
# or the largest exponent.
BY_MEASUREMENTS = [6, 12, 24, 48]
BY_JOINTS = [3, 5, 7, 9, 12]
SERIES = [
    ("objective and gradient", "measurements", BY_MEASUREMENTS, "objective_{}", 50, "linear"),
    ("identification, linear", "measurements", BY_MEASUREMENTS, "identify_linear_{}", 50, "linear"),
    ("identification, nonlinear", "measurements", BY_MEASUREMENTS, "identify_nonlinear_{}", 2, "linear"),
    ("objective and gradient of 6 measurements", "joints", BY_JOINTS, "objective_joints_{}", 50, 2.0),
    ("static equilibrium", "joints", BY_JOINTS, "equilibrium_joints_{}", 50, 2.0),
    ("Monte Carlo, model level", "blocks of 2048 runs", [1, 2, 4, 8], "study_model", None, "linear"),
    ("Monte Carlo, robot level", "blocks of 64 runs", [1, 2, 4], "study_robot", None, "linear"),
]
# A count may be so far from a straight line.
STRAIGHT = 0.03


def exponent(counts: dict[int, float]) -> float:
    """The growth's exponent between the two largest sizes."""
    (small, less), (large, more) = list(counts.items())[-2:]
    return math.log(more / less) / math.log(large / small)


def bend(counts: dict[int, float]) -> float:
    """How far the counts are from the straight line through the first and the last, relative to it."""
    sizes = list(counts)
    first, last = sizes[0], sizes[-1]
    slope = (counts[last] - counts[first]) / (last - first)
    line = {size: counts[first] + slope * (size - first) for size in sizes}
    return max(abs(counts[size] / line[size] - 1) for size in sizes)


def holds(counts: dict[int, float], growth: str | float) -> bool:
    if growth == "linear":
        return bend(counts) <= STRAIGHT
    return exponent(counts) <= growth


def test() -> None:
    """A wrong growth shows: quadratic counts are not straight, cubic ones exceed the exponent."""
    assert holds({6: 7.0, 12: 13.0, 24: 25.0, 48: 49.0}, "linear")
    assert not holds({6: 36.0, 12: 144.0, 24: 576.0, 48: 2304.0}, "linear")
    assert not holds({size: size + 0.01 * size**2 for size in BY_MEASUREMENTS}, "linear")
    assert not holds({size: size**3.0 for size in BY_JOINTS}, 2.0)


def counted(counter: Counter) -> list[dict]:
    result = []
    for name, by, sizes, path, times, growth in SERIES:
        if times is None:
            # The number of repetitions itself is what grows.
            start = counter.total(path, 0)
            counts = {size: counter.total(path, size) - start for size in sizes}
        else:
            found = counter.all({path.format(size): times for size in sizes})
            counts = dict(zip(sizes, found.values()))
        result.append({"name": name, "by": by, "instructions": counts, "growth": growth})
        print_row(result[-1])
    return result


def print_row(row: dict) -> None:
    counts, growth = row["instructions"], row["growth"]
    if growth == "linear":
        told = f"linear within {100 * bend(counts):.2f} %"
    else:
        told = f"exponent {exponent(counts):.2f}, at most {growth:g}"
    numbers = ", ".join(f"{size}: {count / 1e3:,.1f}" for size, count in counts.items())
    print(f"| {row['name']} | {row['by']} | {numbers} | {told} |")


def threads() -> dict[int, float]:
    """Runs per second of the model level on 1, 2, 4, ... threads, in turn; the median of nine."""
    driver, cores = Driver(), len(os.sched_getaffinity(0))
    counts = [2**power for power in range(cores.bit_length()) if 2**power <= cores]
    blocks = 400
    rates = {count: [] for count in counts}
    for _ in range(9):
        for count in counts:
            seconds = driver.seconds(f"study_model_threads_{count}", blocks)
            rates[count].append(2048 * blocks / seconds)
    driver.close()
    return {count: statistics.median(values) for count, values in rates.items()}


def main() -> int:
    test()
    try:
        where()
    except Missing as missing:
        print(f"skipped: {missing}")
        return 0
    print("| work | by | thousand instructions | growth |\n|---|---|---|---|")
    rows = counted(Counter())
    broken = [row["name"] for row in rows if not holds(row["instructions"], row["growth"])]
    for name in broken:
        print(f"error: {name} does not grow as it should", file=sys.stderr)
    if "--check" not in sys.argv:
        rates = threads()
        print("\nMonte Carlo, model level, runs per second by threads, on this machine as busy as it is:")
        print(", ".join(f"{count}: {rate / 1e6:.2f} million" for count, rate in rates.items()))
        (ROOT / "out").mkdir(exist_ok=True)
        record = {"rows": rows, "runs_per_s_by_threads": rates}
        (ROOT / "out/scaling.json").write_text(json.dumps(record, indent=2) + "\n")
        (ROOT / "out/scaling.svg").write_text(picture(rows, rates))
        print("wrote out/scaling.json and out/scaling.svg")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
