"""What makes the package pleasant: keywords that complete, arrays that are checked, changed scenarios, tables and pictures."""

from __future__ import annotations

import copy
import inspect
import pickle
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import elastocal as ec
from elastocal._commands import OPTIONS_OF_THE_PROGRAM_ALONE, options

from test_elastocal import PAPER, PROGRAM, QUICK, ROOT, needs_program

METHODS = {"design": "plan", "import_table": "import", "compensate_targets": "compensate"}
DOWN = [0, 0, -200, 0, 0, 0]


@pytest.fixture(scope="module")
def scenario() -> ec.Scenario:
    return ec.Scenario.load(QUICK)


@pytest.fixture(scope="module")
def design(scenario: ec.Scenario) -> ec.Design:
    return scenario.design(no_proof=True)


# Keywords.


def test_types_of_keywords_are_those_of_the_command_line() -> None:
    checked = subprocess.run([sys.executable, ROOT / "tools/python-options", "--check"], capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stderr


@needs_program
def test_signatures_have_every_option_of_the_program() -> None:
    functions = {name: each for name, each in inspect.getmembers(ec.Scenario, inspect.isfunction) if not name.startswith("_")}
    functions |= {name: getattr(ec, name) for name in ("compare", "init", "import_table", "merge", "explain")}
    seen = set()
    for name, function in functions.items():
        command = METHODS.get(name, name)
        if command not in options():
            continue
        seen.add(command)
        text = subprocess.run([PROGRAM, command, "--help"], capture_output=True, text=True, check=True).stdout
        shown = {each.replace("-", "_") for each in re.findall(r"^ +(?:-\w, )?--([a-z-]+)", text, flags=re.MULTILINE)}
        hidden = {each["name"] for each in options()[command] if each["is_hidden"]}
        taken = set(inspect.signature(function).parameters)
        assert shown - OPTIONS_OF_THE_PROGRAM_ALONE - hidden <= taken, name
        assert not any(each.kind is inspect.Parameter.VAR_KEYWORD for each in inspect.signature(function).parameters.values()), name
    assert seen == set(options()) - {"schema"}
    assert "how many" in (ec.Scenario.select.__doc__ or "").lower()


@pytest.mark.parametrize(
    ("method", "given", "message", "hint"),
    [
        ("design", {"experimnts": 4}, "plan has no option 'experimnts'", "did you mean 'experiments'"),
        ("design", {"experiments": -1}, r"invalid value '-1' for 'experiments': 1 to 10000 is allowed", None),
        ("design", {"experiments": "four"}, "invalid value 'four' for 'experiments': a whole number from 0 on is wanted", None),
        ("design", {"seed": 1.5}, "invalid value '1.5' for 'seed': a whole number", None),
        ("design", {"no_proof": True, "prove": "1%"}, "'no_proof' cannot be used with", None),
        ("design", {"no_proof": 3}, "no_proof is True or False, not 3", None),
        ("design", {"plan_out": True}, "plan_out wants a value", None),
        ("design", {"experiments": [3, 4]}, "experiments is one value", None),
        ("design", {"experiments": object()}, "experiments is text, a number or a path, not a object", None),
        ("design", {"threads": 0}, "invalid value 0 for 'threads': a whole number from 1 to 65535 is wanted", None),
        ("design", {"threads": "1"}, "invalid value '1' for 'threads'", None),
        ("design", {"threads": 1.5}, "invalid value 1.5 for 'threads'", None),
        ("design", {"threads": -1}, "invalid value -1 for 'threads'", None),
        ("study", {"threads": 0, "executor": ThreadPoolExecutor(1)}, "invalid value 0 for 'threads'", None),
        ("study", {"shards": 0, "executor": ThreadPoolExecutor(1)}, "invalid value 0 for 'shards'", None),
        ("design", {"allow": "\ud800"}, r"allow: found '\\ud800'; text that UTF-8 has is wanted", None),
        ("study", {"level": "robots"}, "invalid value 'robots' for 'level'", "robot"),
    ],
)
def test_wrong_usage_is_told_in_python_s_words(
    scenario: ec.Scenario, method: str, given: dict[str, Any], message: str, hint: str | None
) -> None:
    with pytest.raises(ec.UsageError, match=message) as raised:
        getattr(scenario, method)(**given)
    assert "--" not in f"{raised.value} {raised.value.hint}"
    assert hint is None or hint in str(raised.value.hint)


def test_what_is_no_plan_and_no_table_is_told(scenario: ec.Scenario, design: ec.Design, tmp_path: Path) -> None:
    measured = scenario.measure(design.plan)
    identified = scenario.identify(measured)
    bad = tmp_path / "bad.csv"
    bad.write_text("a,b\n1,2\n", encoding="utf-8")
    anything: Any = scenario
    for mistake, message, hint in [
        (lambda: anything.evaluate(np.zeros((3, 3))), "plan wants Plan, Design, Validation or a file's path, not ndarray", "ec.Plan(q_deg, wrench)"),
        (lambda: anything.evaluate(measured), "plan wants .* not Measurements", "ec.Plan"),
        (lambda: anything.identify(design), "measurements wants Measurements, Readings or a file's path, not Design", "ec.read_table"),
        (lambda: anything.validate(measured, identified), "identified wants Identified or a file's path, not Measurements", "identify"),
        (lambda: anything.study(plans=[design.plan]), "plans are a dict of plans by name, not a list", "plans={"),
        (lambda: anything.study(executor=4), "executor is one of concurrent.futures", "get_executor"),
        (lambda: anything.problem.objective(design.plan.q_deg), "plan is a Plan, not a ndarray", "ec.Plan"),
        (lambda: ec.Scenario.load(ROOT / "models/planar_3r.xml"), "is a robot's model; a scenario is wanted", "ec.init"),
        (lambda: ec.Plan.load(bad), "bad.csv: a plan has the columns q1_deg and so on, fx_n, .*; found a, b", ""),
        (lambda: ec.Measurements.load(bad), "bad.csv: a table of measurements has .* dz_mm; found a, b", ""),
        (lambda: ec.Scenario(tmp_path / "none.toml").problem, "none.toml: cannot be read", ""),
        (lambda: scenario.problem.violations([[1, 2]]), "the plan has 2 columns of angles; the robot has 3 commanded joints", ""),
        (lambda: scenario.problem.observation_matrix([1, 2], DOWN), "found 2 coordinates; the robot has 3 commanded joints", ""),
    ]:
        with pytest.raises(ec.ElastocalError, match=message) as raised:
            mistake()
        assert hint in str(raised.value.hint)
    assert len(scenario.design(np.float64(4.0), no_proof=True)) == 4  # type: ignore[arg-type]


def test_hints_have_no_options_of_the_command_line(design: ec.Design) -> None:
    with pytest.raises(ec.UsageError, match="there is no command 'plann'") as raised:
        ec.command("plann", QUICK)  # type: ignore[call-overload]
    assert raised.value.hint == "did you mean 'plan'?"
    assert ec.__version__ == ec.VERSION


# Arrays.

Q = [[10, 20, 30], [-40, 50, -60]]


@pytest.mark.parametrize(
    ("make", "message", "hint"),
    [
        (lambda: ec.Plan(np.radians(Q), DOWN), "no angle above 1.05 in 2 configurations: these are radians", "unit='rad'"),
        (lambda: ec.Plan(Q, DOWN, unit="rad"), "an angle of 60 rad: these are degrees", "leave unit"),
        (lambda: ec.Plan(Q, DOWN, unit="grad"), "unit is 'deg' or 'rad'", None),  # type: ignore[arg-type]
        (lambda: ec.Plan(Q, [0, 0, -200]), r"wrench has the shape \(3,\); rows of 6 are wanted", "fx_n"),
        (lambda: ec.Plan(Q, np.zeros((6, 2))), r"wrench has the shape \(6, 2\)", "wrench.T has rows of 6"),
        (lambda: ec.Plan(Q, np.zeros((3, 6))), "wrench has 3 rows, and q_deg has 2", "one for all"),
        (lambda: ec.Plan(Q, DOWN, [1, 2, 3]), "repeats has 3 rows, and q_deg has 2", None),
        (lambda: ec.Plan(Q, DOWN, 0), "repeats are whole numbers from 1 on", None),
        (lambda: ec.Plan([[10, 20], [30]], DOWN), "q_deg wants rows of numbers", None),
        (lambda: ec.Plan([[10, np.nan, 20]], DOWN), "q_deg has nan in row 0, column 1", None),
        (lambda: ec.Plan(np.zeros((2, 2, 3)), DOWN), r"q_deg has the shape \(2, 2, 3\)", None),
        (lambda: ec.Plan(Q, DOWN, columns=["q1_deg", "q2_deg", "q3_m"]), "columns are q1_deg, or q1_mm .*, not 'q3_m'", "columns="),
        (lambda: ec.Plan(Q, DOWN, np.ma.masked_array([1, 2], [False, True])), "repeats has a masked value in row 1, column 0", None),
        (lambda: ec.Plan(np.array(Q) + 1j, DOWN), "q_deg wants rows of numbers, .*: found complex ones", None),
        (lambda: ec.Plan([np.ma.masked_array(row, [0, 1, 0]) for row in Q], DOWN), "q_deg has a masked value in row 0, column 1", None),
        (lambda: ec.Measurements(Q, DOWN, np.ma.masked_less([[0, 0, 1], [5, 0, -1]], 0)), "mm has a masked value in row 1, column 2", None),
        (lambda: ec.Measurements(Q, DOWN, [[0, 0, 1]]), "deflection_mm has 1 rows, and q_deg has 2", None),
        (lambda: ec.Measurements(Q, DOWN, np.zeros((3, 2))), r"deflection_mm has the shape \(3, 2\)", "deflection_mm.T"),
        (lambda: ec.Measurements(Q, DOWN, [[0, 0, 1], [0, 0, np.inf]]), "deflection_mm has inf in row 1, column 2", None),
    ],
)
def test_arrays_are_checked_when_they_are_given(make: Any, message: str, hint: str | None) -> None:
    with pytest.raises(ec.UsageError, match=message) as raised:
        make()
    assert hint is None or hint in str(raised.value.hint)
    if sys.version_info >= (3, 11):
        assert hint is None or hint in raised.value.__notes__[0]


def test_plans_are_sequences(scenario: ec.Scenario, design: ec.Design) -> None:
    plan = design.plan
    assert len(plan) == len(list(plan)) == 3 and plan[:2] == ec.Plan(plan.q_deg[:2], plan.wrench[0], unit="deg") != plan
    assert np.allclose(ec.Plan(np.radians(Q), DOWN, unit="rad").q_deg, Q)
    assert scenario.measure(design).rows.tolist() == scenario.measure(plan).rows.tolist()
    with pytest.raises(ec.UsageError, match="the table of measurements has 4 columns of angles"):
        scenario.identify(ec.Measurements([[10, 20, 30, 40]], DOWN, [[0, 0, 1]]))
    with pytest.raises(ec.UsageError, match="the plan has 4 columns of angles; the robot has 3 commanded joints: q1_deg"):
        scenario.evaluate(ec.Plan([[10, 20, 30, 40]], DOWN))


def test_plans_keep_directions_and_sides(tmp_path: Path) -> None:
    gauge = ec.Scenario.load(ROOT / "scenarios/kr270_gauge.toml")
    design = gauge.design(experiments=4, no_proof=True)
    assert design.plan.direction is not None and np.allclose(np.linalg.norm(design.plan.direction, axis=1), 1)
    design.plan.save(tmp_path / "plan.csv", gauge.columns)
    assert ec.Plan.load(tmp_path / "plan.csv") == design.plan
    assert (design.plan[:2] + design.plan[2:]) == design.plan
    measured = gauge.measure(design.plan)
    assert measured.displacement_mm.shape == (4,) and "displacement" in repr(measured)
    with pytest.raises(ec.UsageError, match="no deflections"):
        _ = measured.deflection_mm
    assert gauge.identify(measured).results["rank"] > 0
    sides = ec.Plan([[0, -60, 90, 0, 45, 0]] * 2, DOWN, approach=["++++++", "------"])
    sides.save(tmp_path / "sides.csv")
    assert ec.Plan.load(tmp_path / "sides.csv").approach == sides.approach
    assert sides[[1]].approach == ["------"] and sides != ec.Plan(sides.q_deg, DOWN)


def test_one_robot_is_measured_again(design: ec.Design) -> None:
    scenario = ec.Scenario.load(ROOT / "scenarios/kr270.toml")
    plan = ec.Plan.load(ROOT / "scenarios/plans/klimchik2012_m3.csv")
    both = plan + plan[[2, 0]]
    assert len(both) == 5 and both[:3] == plan
    first, all_of_it = scenario.measure(plan, run=4), scenario.measure(both, run=4)
    again = all_of_it[len(first) :]
    assert np.array_equal(all_of_it[:3].rows, first.rows) and len(again) == 2
    # Other noise on the same robot: far nearer than another robot is.
    off = np.linalg.norm(again.deflection_mm - first.deflection_mm[[2, 0]], axis=1)
    other = np.linalg.norm(scenario.measure(plan, run=5).deflection_mm - first.deflection_mm, axis=1)
    assert 0 < off.max() < 0.5 * other.max()
    # It is known to be of that virtual robot, so that compensation is judged.
    residuals_m = [scenario.compensate(scenario.identify(each)).residual_m for each in (first, all_of_it[:3])]
    assert np.isfinite(residuals_m[0]).all() and np.array_equal(*residuals_m)
    assert repr(first[3:]) == "<Measurements: none>"
    with pytest.raises(ec.UsageError, match="the plans have 6 and 3 joints"):
        plan + design.plan


def test_plans_of_absolute_readings_are_read_virtually(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    scenario = ec.Scenario.load(ROOT / "tests/golden/ur10_readings.toml")
    design = scenario.design(experiments=30, parameters="compliances", draw=20)
    readings = scenario.measure_absolute(design, run=3)
    table = readings.to_dataframe()
    assert len(readings) == 30 == design.plan.measurements and np.allclose(table["sx_mm"], 0.04 / np.sqrt(2))
    # What the run's robot is, nobody is told: neither compliances nor frames.
    assert "compliance" not in readings.csv() and readings.csv() == scenario.measure_absolute(design, run=3).csv()
    assert not np.allclose(table["x_mm"], scenario.measure_absolute(design, run=4).to_dataframe()["x_mm"], atol=10)
    identified = scenario.identify(readings, parameters="all")
    assert 0.5 < identified.results["distance_mm"]["rms"] / (0.04 * np.sqrt(1.5)) < 2.0
    assert scenario.validate(identified, scenario.measure_absolute(design, run=3, series=1)).results["distance_mm"]["mean"] < 0.1
    # Without anything uncertain, repeats differ by the instrument's noise alone, and poses have orientations.
    certain = scenario.with_(uncertainty=[], rotation_sigma_mrad=0.1)
    plan = tmp_path / "plan.csv"
    plan.write_text("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,repeats,target,station\n90,-80,55,70,-70,-130,400,spindle,door\n", encoding="utf-8")
    poses = certain.measure_absolute(plan)
    rows = poses.to_dataframe()
    assert repr(poses) == "<Readings: 400 poses>" and rows[["x_mm", "y_mm", "z_mm"]].std().to_numpy() == pytest.approx(0.04 / np.sqrt(2), rel=0.15)
    assert rows["qw"].std() > 0 and set(rows["station"]) == {"door"}
    with pytest.raises(ec.UsageError, match="accuracy is absolute: measure_absolute"):
        scenario.measure(plan)
    with pytest.raises(ec.UsageError, match="accuracy is relative: measure"):
        ec.Scenario.load(QUICK).measure_absolute(plan)
    with pytest.raises(ec.ElastocalError, match="noise_free is for plans of deflections"):
        scenario.measure_absolute(plan, noise_free=True)


# Scenarios.


def test_scenarios_are_changed(scenario: ec.Scenario, design: ec.Design, tmp_path: Path) -> None:
    finer = scenario.with_(sigma_mm=0.015)
    assert finer.problem.sigma_m == pytest.approx(scenario.problem.sigma_m / 2)
    other = finer.with_({"test_pose.0.weight": 2.0, "design": {"experiments": 5}}, seed=np.int64(3))
    assert len(other.design(no_proof=True)) == 5 and other.problem.sigma_m == finer.problem.sigma_m
    assert repr(finer) == "<Scenario planar_3r.toml with sigma_mm=0.015>"
    other.save(tmp_path / "kept.toml")
    del finer, other
    kept = ec.Scenario.load(tmp_path / "kept.toml")
    assert kept.design(no_proof=True).results["provenance"]["seed"] == 3
    # The same file, written anew, has the same bits.
    assert scenario.with_().design(no_proof=True).plan == design.plan


def test_scenarios_and_problems_are_copied_and_pickled(scenario: ec.Scenario, design: ec.Design) -> None:
    changed = scenario.with_(sigma_mm=0.015)
    objective = changed.problem.objective(design.plan)[0]
    problem = pickle.loads(pickle.dumps(changed.problem))
    assert problem.objective(design.plan)[0] == objective
    copies = [pickle.loads(pickle.dumps(changed)), copy.copy(changed)]
    assert repr(copies[0]) == repr(changed)
    # The changed file goes with the scenario that it is of, and each copy has its own.
    del changed
    assert [each.problem.objective(design.plan)[0] for each in copies] == [objective] * 2
    scenario.problem
    assert pickle.loads(pickle.dumps(scenario)).columns == scenario.columns


@pytest.mark.parametrize(
    ("changes", "message", "hint"),
    [
        ({"sigma_m": 1}, "no key 'sigma_m'", "'instrument.sigma_mm'"),
        ({"instrument.sigma": 1}, "no key 'instrument.sigma'", "'instrument.sigma_mm'"),
        ({"experiments": 1}, "'experiments' is a key of several tables: design.experiments or study.experiments", "with_"),
        ({"test_pose.7.weight": 1}, "test_pose.7.weight: the scenario has 1 of them", None),
        ({"sigma_mm": -1}, "^instrument.sigma_mm: found -1; a positive number is allowed", None),
        ({"sigma_mm": float("nan")}, "^instrument.sigma_mm: found nan; finite numbers", None),
        ({"study.sweep": {"sigma_mm": np.array([0.1, np.inf])}}, "^study.sweep: found {'sigma_mm': array", None),
        ({"description": "\ud800"}, r"^description: found '\\ud800'; finite numbers, text that UTF-8 has", None),
        ({3: 1}, "no key 3", None),
        ({"sigma_mm": "much"}, "sigma_mm|invalid type", None),
        ({"robot.model": "none.xml"}, "none.xml", None),
    ],
)
def test_wrong_changes_are_told(scenario: ec.Scenario, changes: dict[str, Any], message: str, hint: str | None) -> None:
    with pytest.raises(ec.ElastocalError, match=message) as raised:
        scenario.with_(changes)
    assert hint is None or hint in str(raised.value.hint)


def test_studies_take_plans(scenario: ec.Scenario, design: ec.Design, tmp_path: Path) -> None:
    design.plan.save(tmp_path / "own.csv", scenario.columns)
    study = scenario.study(plans={"mine": design.plan, "file": tmp_path / "own.csv", "random": "random_each"}, trials=300)
    means = study.to_dataframe().set_index("name")["mean_mm"]
    assert list(means.index) == ["mine", "file", "random"] and means["mine"] == means["file"] < means["random"]


def test_plans_of_a_study_have_any_names(scenario: ec.Scenario, design: ec.Design) -> None:
    names = ["10 N/mm", "../../up", "measurements", "identified", "plans"]
    study = scenario.study(plans={name: design.plan for name in names}, trials=20)
    assert [plan["name"] for plan in study["plans"]] == names
    far = ec.Plan([[1e9, 0, 0]], DOWN, unit="deg")
    for plan, message in [(far, "^study.plan.0..file: 10 N/mm: line 2: q1_deg"), (None, "10 N/mm wants Plan, .*, not NoneType")]:
        with pytest.raises(ec.ElastocalError, match=message):
            scenario.study(plans={"10 N/mm": plan}, trials=20)  # type: ignore[dict-item]


# Slides.


@pytest.fixture(scope="module")
def slide(tmp_path_factory: pytest.TempPathFactory) -> ec.Scenario:
    """The planar arm with an upright slide as its first joint."""
    folder = tmp_path_factory.mktemp("slide")
    model = (ROOT / "models/planar_3r.xml").read_text(encoding="utf-8")
    model = model.replace('<joint name="joint_1"', '<joint name="joint_1" type="slide" axis="0 0 1"')
    (folder / "slide.xml").write_text(re.sub("<keyframe>.*</keyframe>", "", model, flags=re.DOTALL), encoding="utf-8")
    changes = {"robot.model": str(folder / "slide.xml"), "test_pose.0.q_deg": [-300, 80, 40]}
    return ec.Scenario.load(QUICK).with_(changes)


def test_what_a_scenario_answers_has_its_columns(slide: ec.Scenario, tmp_path: Path) -> None:
    plan = slide.design(3).plan
    plan.save(tmp_path / "plan.csv")
    assert (tmp_path / "plan.csv").read_text(encoding="utf-8").startswith("q1_mm,q2_deg,q3_deg")
    identified = slide.identify(slide.measure(plan))
    found = slide.compensate(identified)
    assert np.allclose(found.angles_rad, found.q_commanded_deg * [1e-3, np.pi / 180, np.pi / 180])


def test_files_of_another_kind_are_not_written_over(tmp_path: Path) -> None:
    scenario = ec.Scenario.load(QUICK)
    plan = ec.Plan([[0, 80, 40]], DOWN)
    for name, save in (("arm.xml", scenario.save), ("s.toml", plan.save)):
        (tmp_path / name).write_text("precious", encoding="utf-8")
        with pytest.raises(ec.UsageError, match="is there and no"):
            save(tmp_path / name)
        assert (tmp_path / name).read_text(encoding="utf-8") == "precious"
    with pytest.raises(ec.ElastocalError, match="cannot be written"):
        plan.save(tmp_path / "nowhere" / "plan.csv")
    assert not list(tmp_path.glob("tmp*"))


def test_slides_are_in_millimetres_and_with_rad_in_metres(slide: ec.Scenario, tmp_path: Path) -> None:
    columns = slide.columns
    assert columns == ["q1_mm", "q2_deg", "q3_deg"]
    q, metres = np.array([[250, 20, 30], [-400, 50, -60], [0, -70, 80]]), np.array([1e-3, *np.radians([1, 1])])
    plan = ec.Plan(q * metres, DOWN, unit="rad", columns=columns)
    assert np.allclose(plan.q_deg, q) and plan.csv().startswith("q1_mm,q2_deg")
    measured = slide.measure(ec.Plan(q, DOWN))
    compliances = [
        slide.identify(each).compliance_rad_per_nm
        for each in (
            measured,
            ec.Measurements(q, DOWN, measured.deflection_mm),
            ec.Measurements(q * metres, DOWN, measured.deflection_mm, columns, unit="rad"),
        )
    ]
    assert np.array_equal(*compliances[:2]) and np.allclose(*compliances[1:], rtol=1e-9)
    # Without the columns, what is in rad is of hinges, in parts and sums of plans too.
    turned = ec.Plan(q / 100, DOWN, unit="rad")
    turned.save(tmp_path / "hinges.csv")
    uses: list[tuple[Any, Any]] = [
        (slide.evaluate, turned),
        (slide.evaluate, turned[:1]),
        (slide.evaluate, ec.Plan(q, DOWN) + turned),
        (slide.evaluate, ec.Plan.load(tmp_path / "hinges.csv")),
        (slide.problem.objective, turned),
        (slide.problem.information, turned),
        (slide.problem.violations, turned),
        (slide.identify, ec.Measurements(q / 100, DOWN, measured.deflection_mm, unit="rad")),
    ]
    for use, wrong in uses:
        with pytest.raises(ec.UsageError, match="has the columns q1_deg, .*; those of the robot are q1_mm, q2_deg, q3_deg") as raised:
            use(wrong)
        assert "columns=scenario.columns" in str(raised.value.hint)
    with pytest.raises(ec.UsageError, match="the plans have the columns q1_mm, .* and q1_deg, q2_deg, q3_deg"):
        plan + turned
    # A slide is no angle that could be in degrees or in rad.
    with pytest.raises(ec.UsageError, match="no angle above 1.4 in 3 configurations: these are radians"):
        ec.Plan(q * [1, *metres[1:]], DOWN, columns=columns)


def test_columns_of_a_file_come_in_any_order(slide: ec.Scenario, tmp_path: Path) -> None:
    plan = ec.Plan([[250, 20, 30], [-400, 50, -60]], DOWN)
    lines = [line.split(",") for line in plan.csv(slide.columns).splitlines()]
    (tmp_path / "plan.csv").write_text("\n".join(",".join([*line[2::-1], *line[3:]]) for line in lines), encoding="utf-8")
    assert ec.Plan.load(tmp_path / "plan.csv") == plan


def test_tables_have_a_unit_for_each_joint(slide: ec.Scenario) -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(np.random.default_rng(1).uniform(-1, 1, (8, 6)), columns=["a", "b", "c", "x", "y", "z"])
    columns = {"joints": ["a", "b", "c"], "position": ["x", "y", "z"]}
    table = ec.read_table(frame, columns=columns, units={"joints": ["m", "rad", "deg"], "position": "m"}).to_dataframe()
    assert list(table)[:3] == slide.columns
    assert np.allclose(table[slide.columns], frame[["a", "b", "c"]] * [1e3, np.degrees(1), 1])
    assert list(ec.read_table(frame, columns=columns, units={"joints": "deg"}).to_dataframe())[0] == "q1_deg"
    with pytest.raises(ec.UsageError, match="units.'joints'. has 2 units, and columns.'joints'. has 3 joints"):
        ec.read_table(frame, columns=columns, units={"joints": ["m", "rad"]})
    with pytest.raises(ec.ElastocalError, match='unknown column "q1_deg"') as raised:
        slide.with_(accuracy="absolute").identify(ec.read_table(frame, columns=columns, units={"joints": "rad"}))
    assert "units={'joints': ['mm', 'deg', ...]}" in str(raised.value.hint)


def test_violations_are_those_of_check(scenario: ec.Scenario, design: ec.Design) -> None:
    assert scenario.problem.violations(design.plan) == [] == scenario.problem.violations(design.plan.q_deg)
    paper = ec.Scenario.load(ROOT / "scenarios/kr270.toml")
    plan = ec.Plan.load(ROOT / "scenarios/plans/klimchik2012_m3.csv")
    found = paper.problem.violations(plan)
    assert len(found) == 1 and found == paper.check(plan)["problems"] == paper.evaluate(plan, no_proof=True).violations


# Results.


def test_results_are_short_and_have_tables_and_pictures(scenario: ec.Scenario, design: ec.Design) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    pytest.importorskip("pandas")
    measured = scenario.measure(design.plan)
    identified = scenario.identify(measured)
    check = scenario.validate(identified, experiments=4)
    found: list[Any] = [
        design,
        design.plan,
        scenario.evaluate(design.plan, no_proof=True),
        identified,
        scenario.compensate(identified),
        scenario.study(trials=200),
        scenario.budget(up_to=4, no_proof=True),
        check,
        scenario.validate(identified, scenario.measure(check.plan, run=1)),
    ]
    for each in found:
        assert len(repr(each)) < 200 and "<" in each._repr_html_()
        table = each.to_dataframe()
        assert len(table) > 0, each
        axes = each.plot()
        assert axes.has_data() and (axes.get_ylabel() or axes.get_xlabel()), each
        matplotlib.pyplot.close("all")
    assert len(repr(measured)) < 100 and len(measured) == 3 and len(identified) == 3
    assert list(identified.to_dataframe().index) == identified.names
    with pytest.raises(ec.UsageError, match="no list 'plns'; it has: .*plan"):
        design.to_dataframe("plns")


def test_fits_to_absolute_readings_have_tables_and_pictures() -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    pandas = pytest.importorskip("pandas")
    frame = pandas.read_csv(ROOT / "tests/golden/ur10_visits.csv.gz")
    columns: dict[str, Any] = {name: name for name in ("target", "station", "visit")}
    columns |= {"joints": [f"q{joint}_deg" for joint in range(1, 7)], "force": ["fx_n", "fy_n", "fz_n"]}
    columns |= {"position": ["x_mm", "y_mm", "z_mm"], "position_std": ["sx_mm", "sy_mm", "sz_mm"]}
    fitted, others = (ec.read_table(rows, columns=columns) for rows in (frame[:240], frame[240:480]))
    scenario = ec.Scenario.load(ROOT / "tests/golden/ur10_readings.toml")
    identified = scenario.identify(fitted, parameters="compliances")
    unknowns = identified.to_dataframe()
    assert list(unknowns["name"]) == identified.names and list(unknowns)[:4] == ["name", "value", "standard_error", "unit"]
    assert np.allclose(np.sqrt(np.diag(identified.covariance)), unknowns["standard_error"])
    validation = scenario.validate(identified, others)
    table = validation.to_dataframe()
    assert list(table.index)[:2] == ["nominal", "identified"] and table.loc["identified", "mean_mm"] > 0
    for each in (identified, validation):
        axes = each.plot()
        assert axes.has_data() and axes.get_ylabel() and len(repr(each)) < 300
        matplotlib.pyplot.close("all")


def test_messages_name_no_file_that_nobody_has_written() -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(np.random.default_rng(1).uniform(-90, 90, (8, 13)))
    frame.columns = frame.columns.astype(str)
    names = list(frame.columns)
    readings = ec.read_table(frame, columns={"joints": names[:6], "position": names[6:9], "rotation": names[9:12]}, rotation="rotvec")
    with pytest.raises(ec.ElastocalError, match="^measurements: nothing says how precise the orientations are") as raised:
        ec.Scenario.load(ROOT / "scenarios/ur10.toml").identify(readings)
    assert "tmp" not in str(raised.value)


def test_extras_are_named_where_they_are_missing(design: ec.Design, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ImportError, match=r"to_dataframe needs pandas: pip install 'elastocal\[notebook\]'"):
        design.to_dataframe()
    with pytest.raises(ImportError, match="plot needs matplotlib"):
        design.plot()


def test_progress_is_told(capfd: pytest.CaptureFixture[str]) -> None:
    told: list[tuple[str, int, int | None, str]] = []
    ec.show_progress(lambda *words: told.append(words))  # type: ignore[arg-type]
    try:
        ec.Scenario(PAPER).design(experiments=6, no_proof=True, threads=1)
        assert any(what == "searching the plan" and 0 <= done <= (total or 0) for what, done, total, _ in told)
        pytest.importorskip("tqdm")
        ec.show_progress(True)
        ec.Scenario(PAPER).design(experiments=6, no_proof=True, threads=1)
        assert "searching the plan" in capfd.readouterr().err
        ec.show_progress(None)
        ec.Scenario(PAPER).design(experiments=6, no_proof=True, threads=1)
        assert capfd.readouterr().err == ""
    finally:
        ec.show_progress(None)


def test_a_listener_that_fails_ends_the_work() -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("enough")

    ec.show_progress(fail)
    try:
        with pytest.raises(RuntimeError, match="enough"):
            while True:
                ec.Scenario(PAPER).budget(up_to=60, no_proof=True)
    finally:
        ec.show_progress(None)


# Tables.


def test_data_frames_become_readings(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    from scipy.spatial.transform import Rotation

    random = np.random.default_rng(1)
    joints = [f"axis {joint}" for joint in range(1, 7)]
    turned = Rotation.random(20, random_state=1)
    frame = pandas.DataFrame(random.uniform(-3, 3, (20, 6)), columns=joints)
    frame[["x", "y", "z"]] = random.uniform(-1, 1, (20, 3))
    columns: dict[str, Any] = {"joints": joints, "position": ["x", "y", "z"], "target": "reflector"}
    units = {"joints": "rad", "position": "m"}
    same = {}
    for name, rotation in {
        "XYZ": turned.as_euler("XYZ", degrees=True),
        "zyx": turned.as_euler("zyx", degrees=True),
        "quat": turned.as_quat(),
        "matrix": turned.as_matrix().reshape(20, 9),
    }.items():
        names = [f"r{index}" for index in range(rotation.shape[1])]
        made = frame.join(pandas.DataFrame(rotation, columns=names))
        same[name] = ec.read_table(made, columns=columns | {"rotation": names}, rotation=name, units=units)
    same["scipy"] = ec.read_table(frame, columns=columns, rotation=turned, units=units)
    first = same.pop("XYZ")
    assert repr(first) == "<Readings: 20 poses>" and set(first.to_dataframe()["target"]) == {"reflector"}
    for other in same.values():
        one, two = (each.to_dataframe().select_dtypes("number").to_numpy() for each in (first, other))
        assert np.allclose(one[:, :9], two[:, :9], rtol=1e-9) and np.allclose(np.abs(np.sum(one[:, 9:] * two[:, 9:], axis=1)), 1, rtol=1e-9)
    assert np.allclose(first.to_dataframe()["x_mm"], 1e3 * frame["x"]) and np.allclose(first.to_dataframe()["q2_deg"], np.degrees(frame["axis 2"]))
    for changes, message in [
        ({"columns": columns | {"position": ["x", "y", "zz"]}}, "the frame has no column 'zz'"),
        ({"columns": columns | {"joint": joints}}, "columns have no 'joint'"),
        ({"units": None}, r"columns\['joints'\] has no angle above 3 in 20 configurations: these are radians|these are radians"),
        ({"columns": columns | {"rotation": ["x", "y", "z"]}}, "rotation='XYZ' or another"),
        ({"columns": columns | {"rotation": ["x", "y", "z"]}, "rotation": "Xyz"}, "rotation is not 'Xyz'"),
        ({"rotation": "XYZ"}, "columns have no 'rotation'"),
        ({"columns": columns | {"rotation": ["x", "y", "z"]}, "rotation": "quat"}, r"^rotation.columns\[0\]: found .x., which position.columns\[0\] has, too"),
        ({"columns": columns | {"position": ["x", "y"]}}, "^position.columns: found 2; 3 are needed"),
        ({"units": {"joints": "degree"}}, '^joint.0..unit: found "degree"; one of rad, deg'),
        ({"frame": frame.to_numpy()}, "a data frame of pandas is wanted, not ndarray"),
    ]:
        with pytest.raises(ec.ElastocalError, match=message) as raised:
            ec.read_table(**{"frame": frame, "columns": columns, "units": units} | changes)
        assert "/tmp" not in str(raised.value)


# Pages.

#: A block about readings that the project does not hold.
SERIES_C = r"<!-- run where series_c.csv is: .*-->\n+```python\n(.*?)^```"
BLOCK = re.MULTILINE | re.DOTALL


@pytest.mark.parametrize("page", ["docs/python.md", "python/README.md"])
def test_examples_of_pages_run(page: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pandas")
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(ROOT)
    space: dict[str, Any] = {"__name__": "__main__"}
    text = (ROOT / page).read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", re.sub(SERIES_C, "", text, flags=BLOCK), flags=BLOCK)
    assert blocks
    for block in blocks:
        exec(compile(block, page, "exec"), space)


def test_the_example_of_a_real_robot_runs(series_c: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(series_c)
    [block] = re.findall(SERIES_C, (ROOT / "docs/python.md").read_text(encoding="utf-8"), flags=BLOCK)
    space: dict[str, Any] = {"ec": ec}
    exec(compile(block, "docs/python.md", "exec"), space)
    mean = space["distances_mm"]["mean_mm"]
    assert mean["identified"] < 0.7 * mean["nominal"] and mean["with joint errors"] < 0.3 * mean["identified"]


def test_messages_of_the_page_are_those_of_the_package(scenario: ec.Scenario) -> None:
    page = (ROOT / "docs/python.md").read_text(encoding="utf-8")
    q = [[90, 20, 30], [-40, 50, -60]]
    for mistake in (
        lambda: ec.Plan(np.radians(q), DOWN),
        lambda: ec.Plan(q, DOWN, unit="rad"),
        lambda: ec.Plan(q, np.zeros((6, 2))),
        lambda: ec.Measurements(q, DOWN, [[0, 0, 1], [0, 0, np.nan]]),
        lambda: scenario.evaluate(ec.Plan([[10, 20, 30, 40, 50, 60]], DOWN)),
        lambda: scenario.design(experiments=-1),
        lambda: scenario.with_(sigma_m=0.02),
    ):
        with pytest.raises(ec.UsageError) as raised:
            mistake()
        assert f"`{raised.value}`" in page
