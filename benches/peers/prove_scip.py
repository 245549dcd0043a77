"""The proof of the bound against SCIP, a global solver, on the problem of Klimchik et al. 2012.

elastocal proves how large the directional derivative d of any experiment can be. SCIP gets the same question, as elastocal wrote
it down with its proof (the arm, the region, B), with the sines and cosines of the angles as variables: joint ranges are arcs of
circles, and every product of the forward kinematics is a variable, so that all constraints are quadratic. d is divided by the
largest that elastocal found, so that the maximum is 1. What is compared is how far each has proved after the same time at most;
what SCIP finds must not be above what elastocal proved.
"""

import json
import math
import subprocess
import tempfile
import time
from pathlib import Path

from pyscipopt import Model, quicksum

from timing import Result

ROOT = Path(__file__).resolve().parents[2]
NAME = "proof of the bound to 0.1 %"


def beside_scip(limit_s: float) -> list[Result]:
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "proof.json"
        ours, proof = prove(out)
        file = json.loads(out.read_text())
    gap = proof["gap"]
    found = file["proof"]["largest"] / (1 + gap)
    begun = time.perf_counter()
    best, bound = maximise(file["proof"]["question"], found, limit_s)
    elapsed = time.perf_counter() - begun
    assert best <= 1 + 1.1 * gap + 1e-4, f"SCIP found {best} times the largest derivative that elastocal proved"
    note = f"gap {100 * gap:.2g} % and {ratio(bound)} (SCIP found {best:.3f} of the maximum)"
    result = Result(NAME, "SCIP", [ours], [elapsed], note=note, at_least=bound > 1.001)
    return [result]


def ratio(bound: float) -> str:
    return f"a bound of {bound:.3g} times the maximum" if bound > 1.5 else f"{100 * (bound - 1):.2g} %"


def prove(out: Path) -> tuple[float, dict]:
    """The time that the proof adds to `evaluate`, and its gap."""
    scenario = ROOT / "scenarios/klimchik2012.toml"
    plan = ROOT / "scenarios/plans/klimchik2012_m3.csv"
    command = [ROOT / "target/release/elastocal", "evaluate", scenario, "--plan", plan, "--json", "--quiet"]
    seconds = []
    for options in (["--no-proof"], ["--prove", "0.1%", "--proof-out", out]):
        begun = time.perf_counter()
        # The plan lies a little outside of the region: code 3.
        run = subprocess.run(command + options, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=False)
        seconds.append(time.perf_counter() - begun)
    return seconds[1] - seconds[0], json.loads(run.stdout)["proof"]


class Kinematics:
    """Quadratic constraints for an arm whose frames are parallel at zero angle."""

    def __init__(self, model: Model):
        self.model = model

    def named(self, expression, size: float):
        """A variable within +-size that is equal to a quadratic expression; numbers stay numbers."""
        if isinstance(expression, (int, float)):
            return float(expression)
        variable = self.model.addVar(lb=-size, ub=size)
        self.model.addCons(variable == expression)
        return variable

    def angle(self, low: float, high: float):
        sine, cosine = (self.model.addVar(lb=-1, ub=1) for _ in range(2))
        self.model.addCons(sine * sine + cosine * cosine == 1)
        if high - low < 2 * math.pi:
            middle, half = (low + high) / 2, (high - low) / 2
            self.model.addCons(cosine * math.cos(middle) + sine * math.sin(middle) >= math.cos(half))
        return sine, cosine


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def maximise(question: dict, found: float, limit_s: float) -> tuple[float, float]:
    """The largest d over `found` that SCIP comes across, and its upper bound."""
    model = Model()
    model.hideOutput()
    model.setParam("limits/time", limit_s)
    model.setParam("limits/gap", 1e-3)
    make = Kinematics(model)
    arm, region = question["arm"], question["region"]
    reach = sum(math.hypot(*joint["offset_m"]) for joint in arm["joints"]) + math.hypot(*arm["tool_offset_m"])
    frame = [[float(row == column) for row in range(3)] for column in range(3)]
    origin, axes, anchors = [0.0] * 3, [], []
    moved = lambda offset: [
        make.named(origin[row] + sum(frame[column][row] * offset[column] for column in range(3) if offset[column]), reach)
        for row in range(3)
    ]
    for index, joint in enumerate(arm["joints"]):
        assert joint["rotation"][:3] == [0, 0, 0], "frames are parallel"
        axis = next(k for k in range(3) if joint["axis"][k])
        sign = math.copysign(1.0, joint["axis"][axis])
        origin = moved(joint["offset_m"])
        axes.append([sign * entry for entry in frame[axis]])
        anchors.append(origin)
        if index == 0:
            continue  # Under a vertical load the first angle does not matter.
        low, high = sorted(sign * each for each in joint["range_rad"])
        sine, cosine = make.angle(low, high)
        one, other = (axis + 1) % 3, (axis + 2) % 3
        first, second = frame[one], frame[other]
        frame = list(frame)
        frame[one] = [make.named(a * cosine + b * sine, 1) for a, b in zip(first, second)]
        frame[other] = [make.named(b * cosine - a * sine, 1) for a, b in zip(first, second)]
    tool = moved(arm["tool_offset_m"])
    low, _ = region["height_m"]
    model.addCons(tool[2] >= low)
    low, _ = region["radius_m"]
    model.addCons(tool[0] * tool[0] + tool[1] * tool[1] >= low * low)
    model.addCons(frame[2][2] <= region["elevation_sine"])
    model.addCons(frame[2][2] >= -region["elevation_sine"])
    [wrench] = question["loads"]["one_of"]
    force = wrench[2]
    assert wrench == [0, 0, force, 0, 0, 0], "a vertical force"
    columns = []
    for joint in question["parameters"]:
        arms = [make.named(a - b, reach) for a, b in zip(tool, anchors[joint])]
        lever = [make.named(entry, reach) for entry in cross(axes[joint], arms)]
        # In units of the force, which come back with B.
        columns.append([make.named(entry * lever[2], reach**2) for entry in lever])
    parts = []
    for row in question["rows"]:
        weights = [factor * force / math.sqrt(found) for factor in row]
        largest = sum(abs(weight) for weight in weights) * reach**2
        for k in range(3):
            moved_by = quicksum(weight * column[k] for weight, column in zip(weights, columns))
            parts.append(make.named(moved_by, largest))
    objective = model.addVar(lb=0, ub=None)
    model.addCons(objective <= quicksum(part * part for part in parts))
    model.setObjective(objective, "maximize")
    model.optimize()
    best = model.getPrimalbound() if model.getNSols() else 0.0
    return best, model.getDualbound()
