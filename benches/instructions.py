#!/usr/bin/env python3
"""The gate of elastocal's own speed: instruction counts of the hot paths against benches/instructions.json."""

import argparse
import json
import sys
from pathlib import Path

from counting import Counter, Missing, where

BASELINE = Path(__file__).with_name("instructions.json")
TOLERANCE = 0.02
# The hot paths, and how often each is done for a count: some 5e7 instructions, beside which it does not matter
# that starting the program varies by some 1e4.
REPETITIONS = {
    "objective_3": 1500,
    "objective_12": 400,
    "objective_default_3": 200,
    "objective_laboratory_12": 60,
    "search": 1,
    "equilibrium": 500,
    "measurement": 300,
    "measurement_flexible": 150,
    "identify_linear_3": 500,
    "identify_linear_12": 300,
    "identify_nonlinear_3": 30,
    "identify_nonlinear_12": 8,
    "study_model": 10,
    "fit_absolute": 1,
    "fit_joint_errors": 1,
    "study_robot": 1,
    "study_laboratory": 1,
    "trial_absolute": 1,
    "normals": 10,
    "mcap": 1,
    "rrd": 1,
}


def judge(baseline: dict[str, float], found: dict[str, float]) -> list[str]:
    """Prints each count beside the baseline's. Returns what is wrong."""
    problems = []
    for path, count in found.items():
        if path not in baseline:
            problems.append(f"{path} is not in the baseline")
            continue
        change = count / baseline[path] - 1
        remark = ""
        if change > TOLERANCE:
            remark = "  slower"
            problems.append(f"{path} needs {100 * change:.1f} % more instructions than the baseline")
        elif change < -TOLERANCE:
            remark = "  better: make instructions-baseline keeps it"
        print(f"  {path:<24} {count:>16,.0f} {100 * change:>+8.2f} %{remark}")
    return problems


def check() -> int:
    here, stored = where(), json.loads(BASELINE.read_text())
    there = stored["platform"]
    differing = [f"{key} {there.get(key)!r} there, {here[key]!r} here" for key in here if there.get(key) != here[key]]
    if differing:
        print(f"not judged: the baseline is from another platform: {'; '.join(differing)}")
        return 0
    problems = judge(stored["instructions"], Counter().all(REPETITIONS))
    for problem in problems:
        print(f"error: {problem}", file=sys.stderr)
    if problems:
        print("hint: if that is meant, make instructions-baseline and commit it", file=sys.stderr)
    return 1 if problems else 0


def baseline() -> int:
    here, counts = where(), Counter().all(REPETITIONS)
    if BASELINE.exists():
        print("What changes; name it in the commit:")
        stored = json.loads(BASELINE.read_text())
        if stored["platform"] != here:
            print(f"  the platform, from {stored['platform']} to {here}")
        judge(stored["instructions"], counts)
    record = {"platform": here, "instructions": {path: round(count) for path, count in counts.items()}}
    BASELINE.write_text(json.dumps(record, indent=2) + "\n")
    print(f"wrote {BASELINE}")
    return 0


def test() -> int:
    """The gate itself: counting again passes, and a path that does a fifth more is named."""
    where()
    counter, path = Counter(), "objective_3"
    times = REPETITIONS[path]
    stored = {path: counter.each(path, times)}
    assert not judge(stored, {path: counter.each(path, times)}), "unchanged code broke the gate"
    problems = judge(stored, {path: counter.each(path, times, "--slow-down")})
    assert problems and path in problems[0], "a path that is slower by a fifth did not break the gate"
    print("the gate holds: unchanged code passes, a path that does a fifth more breaks it")
    return 0


def main() -> int:
    actions = {"check": check, "baseline": baseline, "test": test}
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("action", choices=actions)
    action = parser.parse_args().action
    try:
        return actions[action]()
    except Missing as missing:
        print(f"skipped: {missing}")
        return 1 if action == "baseline" else 0


if __name__ == "__main__":
    sys.exit(main())
