#!/usr/bin/env python3
"""How elastocal's costs grow with measurements, joints, runs and threads: tables, a picture, and a check.

All but threads are instruction counts, so the growth can be judged on a busy machine.
"""

import json
import math
import os
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

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


# Commands that are larger than usual, and the CPU time (s) that each may take: a third more than the slowest
# run seen on quiet and busy machines (26.6, 23.5, 12.5 s). Two cores do it in half of that.
LARGE = [
    ("budget up to 60 measurements", "budget scenarios/klimchik2012.toml --up-to 60 --no-proof", 36.0),
    ("plan of 20 experiments, 30 joints", "plan {arm} --no-proof", 32.0),
    ("run with 200 test poses", "run {poses} --noise-only --no-proof", 17.0),
]


def large() -> list[dict]:
    """The CPU time of each large command."""
    program, rows = ROOT / "target/release/elastocal", []
    subprocess.run([os.environ.get("CARGO", "cargo"), "build", "--release", "--locked", "--quiet"], cwd=ROOT, check=True)
    with tempfile.TemporaryDirectory() as folder:
        files = {"arm": large_arm(Path(folder), 30), "poses": many_poses(Path(folder), 200)}
        for name, arguments, bound in LARGE:
            command = [program, *arguments.format(**files).split(), "--quiet", "--out", folder]
            before = os.times()
            subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL, check=True)
            after = os.times()
            seconds = after.children_user - before.children_user
            rows.append({"name": name, "cpu_s": seconds, "bound_s": bound})
            print(f"| {name} | {seconds:.1f} s | {bound:.0f} s |", flush=True)
    return rows


def many_poses(folder: Path, count: int) -> Path:
    """The default scenario with so many test poses around its own."""
    text = (ROOT / "scenarios/kr270.toml").read_text().replace("../models", str(ROOT / "models"))
    text = text.replace("plans/", f"{ROOT / 'scenarios/plans'}/")
    table = re.search(r"\[\[test_pose\]\](?:\n(?!\[).*)*", text)[0]
    poses = [re.sub(r'name = ".*"', f'name = "pose {index}"', table) for index in range(count)]
    for index, pose in enumerate(poses):
        angles = [float(angle) for angle in re.search(r"q_deg = \[(.*)\]", pose)[1].split(",")]
        moved = [angle + 5 * math.sin(index * (joint + 1)) for joint, angle in enumerate(angles)]
        poses[index] = re.sub(r"q_deg = \[.*\]", f"q_deg = {moved}", pose)
    (folder / "poses.toml").write_text(text.replace(table, "\n".join(poses)))
    return folder / "poses.toml"


def large_arm(folder: Path, joints: int) -> Path:
    """A serial arm of so many hinges, whose axes point along z, y, y, x, y, x, and so on again."""
    axes = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"]
    names = [f"joint_{number}" for number in range(1, joints + 1)]
    bodies = "".join(
        '<body pos="0 0 0.3"><inertial pos="0 0 0.15" mass="5" diaginertia="0.1 0.1 0.1"/>'
        f'<joint name="{name}" axis="{axes[index % 6]}" range="-2 2"/>'
        for index, name in enumerate(names)
    )
    actuators = "".join(f'<position joint="{name}" kp="300000"/>' for name in names)
    (folder / "arm.xml").write_text(
        '<mujoco><compiler angle="radian"/><default><joint limited="false"/></default><worldbody>'
        f'{bodies}<site name="tool" pos="0.2 0.1 0.3"/>{"</body>" * joints}</worldbody>'
        f"<actuator>{actuators}</actuator></mujoco>"
    )
    angles = [(8 * number) % 90 for number in range(1, joints + 1)]
    (folder / "arm.toml").write_text(
        '[robot]\nmodel = "arm.xml"\ncalibration_site = "tool"\nmachining_site = "tool"\n'
        f'parameters = {json.dumps(names)}\n[instrument]\nsigma_mm = 0.03\nsigma_of = "deflection"\n'
        f"[[test_pose]]\nq_deg = {angles}\nforce_n = [100, 200, -150]\n"
        '[load]\nkind = "any"\nforce_max_n = 400\n[region]\n[design]\nexperiments = 20\n'
    )
    return folder / "arm.toml"


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
    print("\n| large | CPU time | at most |\n|---|---|---|")
    slow = [row for row in large() if row["cpu_s"] > row["bound_s"]]
    for row in slow:
        print(f"error: {row['name']} takes {row['cpu_s']:.1f} s of CPU", file=sys.stderr)
    broken += slow
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
