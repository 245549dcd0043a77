"""The package beside the command line: nothing is missing, and the numbers are the same to the last bit."""

from __future__ import annotations

import gzip
import importlib.util
import inspect
import json
import os
import re
import runpy
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import elastocal as ec
from elastocal._commands import options

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(os.environ.get("ELASTOCAL", ROOT / "target/release/elastocal"))
PAPER = ROOT / "scenarios/klimchik2012.toml"
TABLE4 = ROOT / "scenarios/plans/klimchik2012_m3.csv"
QUICK = ROOT / "scenarios/planar_3r.toml"

needs_program = pytest.mark.skipif(not PROGRAM.exists(), reason="the program is not built (make build)")


def program(*words: object) -> dict[str, Any]:
    """What the program prints with --json."""
    ended = subprocess.run([PROGRAM, *map(str, words), "--json", "--quiet"], capture_output=True, text=True, check=False)
    assert ended.returncode in (0, 3), ended.stderr
    found: dict[str, Any] = json.loads(ended.stdout)
    return found


def same(one: Any, other: Any) -> bool:
    """Whether records are equal but for times, paths and how the program was built."""
    def bare(value: Any) -> Any:
        if isinstance(value, dict):
            left_out = {"elapsed_s", "runs_per_s", "provenance", "scenario_file"}
            return {key: bare(each) for key, each in value.items() if key not in left_out}
        return [bare(each) for each in value] if isinstance(value, list) else value

    return bool(bare(one) == bare(other))


@needs_program
def test_every_command_and_option_of_the_program_is_there() -> None:
    listed = subprocess.run([PROGRAM, "--help"], capture_output=True, text=True, check=True).stdout
    commands = re.findall(r"^  ([a-z-]+)  ", listed, flags=re.MULTILINE)
    assert set(commands) - {"help"} == set(options())
    for name in options():
        text = subprocess.run([PROGRAM, name, "--help"], capture_output=True, text=True, check=True).stdout
        shown = set(re.findall(r"^ +(?:-\w, )?--([a-z-]+)", text, flags=re.MULTILINE))
        taken = {each["long"] for each in options()[name] if each["long"]} | {"help"}
        assert shown <= taken, name


def test_codes_are_explained() -> None:
    [found] = ec.explain("c0102")["codes"]
    assert found["id"] == "C0102" and "region" in found["explanation"]
    with pytest.raises(ec.UsageError, match="nearest"):
        ec.explain("C9999")


def test_every_command_has_a_function() -> None:
    functions = {name for name, _ in inspect.getmembers(ec.Scenario, inspect.isfunction)} | set(ec.__all__)
    # `import` is a word of Python's own.
    names = {"plan": "design", "import": "import_table"}
    for name in options():
        assert names.get(name, name) in functions, name


@needs_program
def test_the_loop_has_the_program_s_bits(tmp_path: Path) -> None:
    scenario = ec.Scenario.load(PAPER)
    design = scenario.design(experiments=3, no_proof=True)
    plan, measured, identified = (tmp_path / name for name in ("plan.csv", "measured.csv", "identified.json"))
    assert same(program("plan", PAPER, "--experiments", 3, "--no-proof", "--plan-out", plan), design.results)
    assert np.array_equal(ec.Plan.load(plan).q_deg, design.plan.q_deg)
    measurements = scenario.measure(design.plan)
    program("measure", PAPER, "--plan", plan, "--measurements-out", measured)
    assert np.array_equal(ec.Measurements.load(measured).rows, measurements.rows)
    assert np.array_equal(scenario.measure(design.plan, run=0).rows, measurements.rows)
    program("measure", PAPER, "--plan", plan, "--run", 7, "--measurements-out", tmp_path / "seventh.csv")
    seventh = scenario.measure(design.plan, run=7)
    assert np.array_equal(ec.Measurements.load(tmp_path / "seventh.csv").rows, seventh.rows)
    assert not np.array_equal(seventh.rows, measurements.rows)
    found = scenario.identify(measurements)
    assert same(program("identify", PAPER, "--measurements", measured, "--identified-out", identified), found.results)
    # The deflections alone, without where they come from, say the same.
    plain = ec.Measurements(measurements.q_deg, measurements.wrench, measurements.deflection_mm)
    assert np.array_equal(scenario.identify(plain).compliance_rad_per_nm, found.compliance_rad_per_nm)
    compensated = scenario.compensate(found)
    assert same(program("compensate", PAPER, "--identified", identified), compensated.results)
    assert compensated.angles_rad.shape == (1, 6)
    assert found.covariance.shape == (5, 5) and found.names == [f"joint_{j}" for j in range(2, 7)]
    errors = np.sqrt(np.diag(found.covariance))
    assert np.allclose(errors, found.compliance_std_rad_per_nm, rtol=1e-12)


@needs_program
def test_angles_for_absolute_targets_have_the_program_s_bits(tmp_path: Path) -> None:
    scenario = ec.Scenario.load(PAPER)
    measured, identified, targets = (tmp_path / name for name in ("measured.csv", "identified.json", "targets.csv"))
    program("measure", PAPER, "--plan", TABLE4, "--measurements-out", measured)
    program("identify", PAPER, "--measurements", measured, "--identified-out", identified)
    found = scenario.identify(ec.Measurements.load(measured))
    # The last one is out of reach.
    targets.write_text("x_mm,y_mm,z_mm\n1500,100,1200\n1500,150,1200\n15000,150,1200\n")
    angles = [tmp_path / name for name in ("program.csv", "python.csv")]
    given = ("--identified", identified, "--targets", targets, "--angles-out", angles[0], "--frame", "base")
    results = scenario.compensate_targets(found, targets, angles_out=angles[1], frame="base")
    assert same(program("compensate", PAPER, *given), results)
    assert angles[0].read_text() == angles[1].read_text()
    assert len(results.conditions) == 1
    with pytest.raises(ec.ElastocalError, match="instrument"):
        scenario.compensate_targets(found, targets, frame="instrument")


@needs_program
def test_assessments_studies_and_budgets_have_the_program_s_bits(tmp_path: Path) -> None:
    scenario = ec.Scenario.load(QUICK)
    plan = scenario.design(no_proof=True).plan
    plan.save(tmp_path / "plan.csv")
    found = scenario.evaluate(plan, no_proof=True)
    assert same(program("evaluate", QUICK, "--plan", tmp_path / "plan.csv", "--no-proof"), found.results)
    assert same(program("budget", QUICK, "--up-to", 3, "--no-proof"), scenario.budget(up_to=3, no_proof=True))
    words = ("--trials", 500, "--out", tmp_path / "out")
    study = scenario.study(trials=500)
    assert same(program("study", QUICK, *words), study)
    assert "Results are in" not in study.text
    assert scenario.check(plan)["ok"] == program("check", QUICK, "--plan", tmp_path / "plan.csv")["ok"]


@needs_program
def test_absolute_plans_have_the_program_s_bits(tmp_path: Path) -> None:
    text = (ROOT / "scenarios/ur10.toml").read_text(encoding="utf-8").replace("../models", str(ROOT / "models"))
    (tmp_path / "s.toml").write_text(text.replace("[design]", '[design]\naccuracy = "absolute"'), encoding="utf-8")
    random = np.random.default_rng(1)
    rows = random.uniform([-170, -120, 40, -170, -170, -170], [170, -40, 120, 170, 170, 170], (60, 6))
    names = ",".join(f"q{joint}_deg" for joint in range(1, 7))
    lines = [",".join([*map(str, row), "spindle", "door"]) for row in rows]
    (tmp_path / "c.csv").write_text("\n".join([f"{names},target,station", *lines]) + "\n", encoding="utf-8")
    scenario = ec.Scenario.load(tmp_path / "s.toml")
    given = {"parameters": ["zeros"], "candidates": tmp_path / "c.csv"}
    design = scenario.design(experiments=10, plan_out=tmp_path / "p.csv", **given)
    printed = program(
        "plan", tmp_path / "s.toml", "--experiments", 10, "--parameters", "zeros", "--candidates", tmp_path / "c.csv"
    )
    assert same(design.results, printed)
    assert design.results["accuracy"] == "absolute" and design.results["frame"] == "door"
    assert design.plan.measurements == 10 and len(design.compliance_std_rad_per_nm) == 0
    again = scenario.evaluate(tmp_path / "p.csv", **given)
    assert again.rho0_m is not None and np.isclose(again.rho0_m, design.rho0_m, rtol=1e-6)


@needs_program
def test_fits_to_absolute_readings_have_the_program_s_bits(tmp_path: Path) -> None:
    golden = ROOT / "tests/golden"
    path = golden / "ur10_readings.toml"
    readings, later, robot, model = (tmp_path / name for name in ("readings.csv", "later.csv", "robot.json", "robot.xml"))
    readings.write_bytes(gzip.decompress((golden / "ur10_gross.csv.gz").read_bytes()))
    later.write_bytes(gzip.decompress((golden / "ur10_later.csv.gz").read_bytes()))
    for name, options in {
        "identify": {"measurements": readings, "parameters": "geometry", "identified_out": robot},
        "validate": {"identified": robot, "measurements": later},
        "compensate": {"identified": robot},
        "export": {"identified": robot, "model_out": model},
    }.items():
        words = [word for key, value in options.items() for word in (f"--{key.replace('_', '-')}", value)]
        assert same(program(name, path, *words), ec.command(name, path, **options)), name


def test_messages_are_those_of_the_command_line(tmp_path: Path) -> None:
    with pytest.raises(ec.ElastocalError, match="missing.toml: cannot be read"):
        ec.Scenario.load(tmp_path / "missing.toml")
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(QUICK.read_text().replace("../models", str(ROOT / "models")).replace("sigma_mm", "sigma_m"))
    with pytest.raises(ec.ElastocalError, match="unknown field `sigma_m`") as raised:
        ec.Scenario.load(wrong)
    assert raised.value.hint == "did you mean `sigma_mm`?"
    with pytest.raises(ec.UsageError, match="no option 'measurments'"):
        ec.command("identify", measurments="x.csv")
    with pytest.raises(ec.UsageError, match="invalid value"):
        ec.command("plan", QUICK, experiments=-1)


def test_conditions_come_with_results() -> None:
    found = ec.Scenario.load(ROOT / "scenarios/kr270.toml").check(ec.Plan.load(TABLE4))
    assert not found["ok"] and found.conditions == [ec.Condition("C0102", "the plan has 1 violation")]


def test_matrices_are_those_of_the_prediction() -> None:
    scenario = ec.Scenario.load(PAPER)
    plan = ec.Plan.load(TABLE4)
    problem = scenario.problem
    posterior = np.linalg.inv(problem.information(plan))
    [rows] = problem.test_pose_matrices()
    rho0_m = scenario.evaluate(plan, no_proof=True).rho0_m
    assert rho0_m is not None
    assert np.isclose(np.sqrt(np.trace(rows @ posterior @ rows.T)), rho0_m, rtol=1e-9)
    value, gradient = problem.objective(plan)
    assert np.isclose(np.sqrt(value), rho0_m, rtol=1e-9)
    step = 1e-5
    for experiment, joint in [(0, 1), (1, 3), (2, 4)]:
        ends = []
        for sign in (1, -1):
            q = plan.q_deg.copy()
            q[experiment, joint] += sign * np.degrees(step)
            ends.append(problem.objective(ec.Plan(q, plan.wrench, plan.repeats))[0])
        assert np.isclose(gradient[experiment, joint], (ends[0] - ends[1]) / (2 * step), rtol=1e-5, atol=1e-18)
    with pytest.raises(ValueError, match="6 commanded joints"):
        problem.observation_matrix([0, 0], [0, 0, -1, 0, 0, 0])


@pytest.mark.parametrize("work", ["budget(up_to=60, no_proof=True)", "study(trials=10**9)", "run()"])
def test_an_interruption_ends_work_soon(work: str) -> None:
    # Work without an end, so that the signal meets it, however quick the machine is.
    text = f"import elastocal as ec\nwhile True: ec.Scenario({str(PAPER)!r}).{work}"
    # Where the tests run in the background, the signal is ignored by whoever inherits that.
    child = subprocess.Popen(
        [sys.executable, "-c", text],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    time.sleep(3)
    child.send_signal(2)
    _, said = child.communicate(timeout=60)
    assert "KeyboardInterrupt" in said


def test_python_goes_on_during_a_search() -> None:
    worker = threading.Thread(target=lambda: ec.Scenario(PAPER).design(experiments=12, no_proof=True))
    worker.start()
    ticks = 0
    while worker.is_alive():
        time.sleep(0.01)
        ticks += 1
    assert ticks > 5


def test_there_is_one_library_of_mujoco() -> None:
    with open("/proc/self/maps", encoding="utf-8") as maps:
        libraries = {line.split()[-1] for line in maps if "libmujoco.so" in line}
    spec = importlib.util.find_spec("mujoco")
    assert spec is not None and spec.origin is not None
    assert libraries == {str((Path(spec.origin).parent / "libmujoco.so.3.17.0").resolve())}


@pytest.mark.parametrize("name", ["own_optimiser", "own_robot"])
def test_examples_run(name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "argv", [name])
    runpy.run_path(str(ROOT / f"python/examples/{name}.py"), run_name="__main__")
    assert "um" in capsys.readouterr().out


def run_notebook(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT / "python/notebooks")
    monkeypatch.setenv("MPLBACKEND", "Agg")
    notebook = json.loads((ROOT / f"python/notebooks/{name}.ipynb").read_text())
    space: dict[str, Any] = {"__name__": "__main__"}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"{name}.ipynb", "exec"), space)


@pytest.mark.parametrize("name", ["fig7", "own_robot", "study_on_dask", "tracker_table", "urdf_to_validated"])
def test_notebooks_run(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    run_notebook(name, monkeypatch)


@pytest.mark.usefixtures("series_c")
def test_the_notebook_of_a_real_robot_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    run_notebook("ur10_series", monkeypatch)


def test_the_notebook_of_a_real_robot_is_skipped_without_its_readings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ELASTOCAL_UR10_IPA", "/nonexistent")
    with pytest.raises(SystemExit, match="skipped: series_c.csv"):
        run_notebook("ur10_series", monkeypatch)


def test_every_notebook_is_run() -> None:
    text = Path(__file__).read_text(encoding="utf-8")
    assert all(f'"{each.stem}"' in text for each in (ROOT / "python/notebooks").glob("*.ipynb"))
