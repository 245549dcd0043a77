"""A scenario and what can be done with it."""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from os import fspath
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._commands import command, read
from ._data import Array, Assessment, Compensation, Design, FilePath, Identified, Measurements, Plan, Results, UsageError
from ._elastocal import PlanningProblem
from ._executor import Executors, merged
from ._executor import study as run_shards

#: The shards of a study on an executor: enough for some workers, and few enough to be worth their while.
SHARDS = 16


@contextmanager
def _folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="elastocal-") as name:
        yield Path(name)


def _gone(folder: Path, results: Results) -> Results:
    """The same results without the sentence that names files in a folder that does not stay."""
    results.text = re.sub(rf" ?[^.\n]*{re.escape(str(folder))}[^\n]*", "", results.text)
    return results


class Problem:
    """The planning problem in numbers, for one's own criterion or optimiser."""

    def __init__(self, path: FilePath, noise_only: bool = False) -> None:
        self._problem = PlanningProblem(str(fspath(path)), noise_only)

    @property
    def columns(self) -> list[str]:
        """The columns of configurations: ``q1_deg``, or ``q1_mm`` for a slide."""
        return self._problem.columns()

    @property
    def parameters(self) -> list[str]:
        """The names of the p parameters."""
        return self._problem.parameters()

    @property
    def sigma_m(self) -> float:
        """The standard deviation of each coordinate of a deflection (m)."""
        return self._problem.sigma_m()

    @property
    def nominal_rad_per_nm(self) -> Array:
        """The nominal compliance of each parameter (p,), rad/(N m)."""
        return np.array(self._problem.nominal_rad_per_nm())

    @property
    def ranges_deg(self) -> Array:
        """Lower and upper ends of the commanded joints' ranges (2, n), deg; slides mm."""
        return np.array(self._problem.ranges())

    def observation_matrix(self, q_deg: ArrayLike, wrench: ArrayLike) -> Array:
        """The position rows of the observation matrix, eq. 7 of the paper: (3, p), m N m/rad.

        ``q_deg`` (n,), deg; ``wrench`` (6,), N and N m at the calibration tool in the world frame.
        """
        q = np.asarray(q_deg, dtype=float).tolist()
        return np.array(self._problem.observation_matrix(q, np.asarray(wrench, dtype=float).tolist()))

    def test_pose_matrices(self) -> list[Array]:
        """Eq. 23 for each test pose, times the root of its weight: (3, p) each, m N m/rad."""
        return [np.array(each) for each in self._problem.test_pose_matrices()]

    def information(self, plan: Plan) -> Array:
        """The information of a plan by noise alone, eq. 12: (p, p), ((N m)/rad)^2."""
        size = len(self.parameters)
        total = np.zeros((size, size))
        for q, wrench, repeats in zip(plan.q_deg, plan.wrench, plan.repeats, strict=True):
            rows = self.observation_matrix(q, wrench)
            total += float(repeats) * (rows.T @ rows)
        return total / self.sigma_m**2

    def objective(self, plan: Plan) -> tuple[float, Array]:
        """rho0^2 (m^2), and its gradient by every coordinate of every experiment (m, joints), m^2/rad; slides m^2/m.

        It has all that the scenario lists as uncertain; passive joints, which nothing commands, have columns, too.
        Experiments of one configuration that share errors turn together: each has the gradient of all of them.
        """
        wrenches = plan.wrench.tolist()
        value, gradient = self._problem.objective(plan.q_deg.tolist(), wrenches, plan.repeats.tolist())
        return value, np.array(gradient)


class Scenario:
    """A scenario file: ``Scenario.load(path)``.

    Every method reads the file anew. ``seed`` replaces the scenario's, ``noise_only`` believes in the instrument's noise
    alone, ``threads`` is how many to use. Options of a command that are not named in a method are keywords all the same.
    """

    def __init__(self, path: FilePath, seed: int | None = None, noise_only: bool = False, threads: int | None = None) -> None:
        self.path = Path(fspath(path))
        self.seed = seed
        self.noise_only = noise_only
        self.threads = threads
        self._problem: Problem | None = None

    @classmethod
    def load(cls, path: FilePath, *, seed: int | None = None, noise_only: bool = False, threads: int | None = None) -> Scenario:
        """Reads and checks a scenario file; raises :class:`ElastocalError` for what is wrong."""
        scenario = cls(path, seed, noise_only, threads)
        scenario.command("check")
        return scenario

    def command(self, name: str, **given: Any) -> Results:
        """Any command of the command line for this scenario, with its options as keywords."""
        given.setdefault("seed", self.seed)
        given.setdefault("noise_only", self.noise_only)
        given.setdefault("threads", self.threads)
        return command(name, self.path, **given)

    @property
    def problem(self) -> Problem:
        """Observation and information matrices, and the objective with its gradient."""
        if self._problem is None:
            self._problem = Problem(self.path, self.noise_only)
        return self._problem

    @property
    def columns(self) -> list[str]:
        """The columns of configurations: ``q1_deg``, or ``q1_mm`` for a slide."""
        return self.problem.columns

    def _with_plan(self, name: str, plan: Plan, **given: Any) -> Results:
        with _folder() as folder:
            plan.save(folder / "plan.csv", self.columns)
            return self.command(name, plan=folder / "plan.csv", **given)

    def check(self, plan: Plan | None = None, parameters: bool = False) -> Results:
        """The robot as it was understood, with ``warnings``; with a plan, ``ok`` and ``problems``."""
        if plan is None:
            return self.command("check", parameters=parameters)
        return self._with_plan("check", plan, parameters=parameters)

    def design(self, experiments: int | None = None, **given: Any) -> Design:
        """Designs a plan of ``experiments`` measurements (the scenario's if not given).

        Further keywords are the options of ``elastocal plan``: ``configurations``, ``minutes``, ``criterion``, ``prove``,
        ``prove_time``, ``no_proof``, ``proof_out``, ``plan_out``; ``candidates``, a CSV of rows that it is chosen
        from; ``test_poses``, a CSV of poses in place of the scenario's. Where accuracy is absolute also ``parameters``, groups of
        unknowns; ``draw``, how many configurations are drawn where there are no ``candidates``; ``report_out``, a page about the plan.
        """
        found = self.command("plan", experiments=experiments, **given)
        return Design(**vars(Assessment.from_results(found)))

    def evaluate(self, plan: Plan | FilePath, **given: Any) -> Assessment:
        """The predicted accuracy of a plan, and the bound that no plan of as many measurements can beat.

        Where accuracy is absolute, a plan that names targets or stations is a file's: its path, as ``plan_out`` wrote it. Keywords
        are then also ``parameters``, groups of unknowns; ``trials``, how many virtual robots are drawn, read as the plan says and
        identified, to see whether it errs as predicted (``results["trials"]``); ``report_out``, a page about all that.
        """
        if isinstance(plan, Plan):
            return Assessment.from_results(self._with_plan("evaluate", plan, **given))
        return Assessment.from_results(self.command("evaluate", plan=plan, **given))

    def budget(self, accuracy_um: float | None = None, up_to: int | None = None, **given: Any) -> Results:
        """How many measurements in how many configurations an accuracy (um, rms) takes."""
        return self.command("budget", accuracy_um=accuracy_um, up_to=up_to, **given)

    def measure(
        self, plan: Plan, *, run: int | None = None, noise_free: bool = False, seed: int | None = None
    ) -> Measurements:
        """Measures a plan on the virtual robot, with the random numbers of a run under the seed (run 0 if not given).

        With ``run``, the robot is that of the run in a study: its compliances are drawn where the scenario has them vary.
        """
        with _folder() as folder:
            out = folder / "measurements.csv"
            chosen = self.seed if seed is None else seed
            self._with_plan("measure", plan, run=run, noise_free=noise_free, measurements_out=out, seed=chosen)
            return Measurements.from_text(read(out))

    def identify(
        self,
        measurements: Measurements | FilePath,
        *,
        method: str | None = None,
        sigma_from_residuals: bool = False,
        parameters: list[str] | None = None,
        model_selection: bool = False,
        against: FilePath | None = None,
        plot_out: FilePath | None = None,
        keep_all: bool = False,
    ) -> Identified:
        """Identifies the compliances; ``method`` is ``nonlinear`` or ``linear``, the scenario's if not given.

        Absolute readings are a file's: its path in place of ``measurements``. ``parameters`` are then groups such as ``geometry``
        and ``compliances``, fitted with all frames; the results' ``unknowns`` and ``stations`` say what came of it. ``model_selection``
        compares models with more and more groups, under ``model_selection`` in the results, and fits the one that is recommended. Another
        series ``against`` which contradicts this one is told under ``inconsistencies``. A picture goes to ``plot_out``. Readings that
        lie far out, deflections too, are left out, unless ``keep_all``.
        """
        with _folder() as folder:
            if isinstance(measurements, Measurements):
                measurements.save(folder / "measurements.csv")
                path: FilePath = folder / "measurements.csv"
            else:
                path = measurements
            return Identified(
                self.command(
                    "identify",
                    measurements=path,
                    method=method,
                    sigma_from_residuals=sigma_from_residuals,
                    parameters=parameters,
                    model_selection=model_selection,
                    against=against,
                    plot_out=plot_out,
                    keep_all=keep_all,
                )
            )

    def select(self, measurements: FilePath, *, parameters: list[str] | None = None, **given: Any) -> Results:
        """Chooses a few of many absolute readings in several ways, calibrates with each choice, and judges on all others.

        Further keywords are the options of ``elastocal select``: ``sizes``, ``draws``, ``campaigns``, ``plot_out``.
        """
        return self.command("select", measurements=measurements, parameters=parameters, **given)

    def compensate(self, identified: Identified, *, method: str | None = None) -> Compensation:
        """The angles to command at the test poses, so that the loaded tool stands where it should."""
        with _folder() as folder:
            path = folder / "identified.json"
            path.write_text(json.dumps(identified.results), encoding="utf-8")
            return Compensation(self.command("compensate", identified=path, method=method))

    def compensate_targets(self, identified: Identified, targets: FilePath, **given: Any) -> Results:
        """The angles to command for absolute targets of a file.

        Further keywords are ``tool``, ``frame``, ``station``, ``workpiece`` and ``angles_out``.
        """
        with _folder() as folder:
            path = folder / "identified.json"
            path.write_text(json.dumps(identified.results), encoding="utf-8")
            return self.command("compensate", identified=path, targets=targets, **given)

    def export(self, identified: Identified, model_out: FilePath) -> Results:
        """Writes the calibrated robot as a model: MJCF where the file ends in ``.xml``, URDF where it ends in ``.urdf``."""
        with _folder() as folder:
            path = folder / "identified.json"
            path.write_text(json.dumps(identified.results), encoding="utf-8")
            return self.command("export", identified=path, model_out=model_out)

    def next(self, measurements: Measurements, plan: Plan, **given: Any) -> Results:
        """What to measure next, after some of a plan is measured."""
        with _folder() as folder:
            measurements.save(folder / "measurements.csv")
            return self._with_plan("next", plan, measurements=folder / "measurements.csv", **given)

    def validate(self, identified: Identified, measurements: Measurements | FilePath | None = None, **given: Any) -> Results:
        """A plan for checking an identification, or, with measurements, whether it errs as it predicts."""
        with _folder() as folder:
            path = folder / "identified.json"
            path.write_text(json.dumps(identified.results), encoding="utf-8")
            if isinstance(measurements, Measurements):
                measurements.save(folder / "measurements.csv")
                given["measurements"] = folder / "measurements.csv"
            elif measurements is not None:
                given["measurements"] = measurements
            return self.command("validate", identified=path, **given)

    def lab(self, plan: Plan, out: FilePath, **given: Any) -> Results:
        """Run sheet, robot program and table to fill in, in a folder under ``out``."""
        return self._with_plan("lab", plan, out=out, **given)

    def study(
        self,
        *,
        out: FilePath | None = None,
        executor: Executors | None = None,
        shards: int | None = None,
        tallies: FilePath | None = None,
        **given: Any,
    ) -> Results:
        """Compares the scenario's plans over many runs: ``trials``, ``level``, ``resume``, ``shard``, ... as ``elastocal study``.

        Where accuracy is absolute also ``parameters``, ``candidates`` and ``draw``, as of :meth:`design`.
        Without ``out`` no file stays.

        With an ``executor``, any of :mod:`concurrent.futures` or a function that makes one, the study is made in ``shards`` (16 if
        not given) by its workers, each with ``threads`` (one if not given), to the same bits. Files that the scenario names are sent
        along. A shard whose worker is lost is made again; with ``tallies``, a folder, shards that are made stay there, and the same
        call goes on from them.
        """
        if executor is None:
            if shards is not None or tallies is not None:
                raise UsageError("shards and tallies are for a study on an executor; `shard` makes one part")
            return self._into("study", out, given)
        given = {"seed": self.seed, "noise_only": self.noise_only, "threads": self.threads or 1} | given
        with _folder() as folder:
            kept = folder / "tallies" if tallies is None else Path(tallies)
            files = run_shards(self.path, executor, shards or SHARDS, kept, given)
            if out is not None:
                return merged(files, out)
            return _gone(folder, merged(files, folder))

    def run(self, *, out: FilePath | None = None, **given: Any) -> Results:
        """The whole loop: design, measure, identify, compensate, beside other plans. Without ``out`` no file stays."""
        return self._into("run", out, given)

    def replay(self, run: int, *, out: FilePath | None = None, **given: Any) -> Results:
        """One run of the study on the virtual robot."""
        return self._into("replay", out, {"run": run, **given})

    def reproduce(self, *, out: FilePath | None = None, **given: Any) -> Results:
        """The paper's numbers beside this program's."""
        return self._into("reproduce", out, given)

    def _into(self, name: str, out: FilePath | None, given: dict[str, Any]) -> Results:
        if out is not None:
            return self.command(name, out=out, **given)
        with _folder() as folder:
            return _gone(folder, self.command(name, out=folder, **given))


def compare(base: FilePath, new: FilePath, **given: Any) -> Results:
    """Two results files against tolerances: ``allow_different``, ``exact``, ``within``, ``markdown``."""
    return command("compare", base, new, **given)


def init(model: FilePath, scenario_out: FilePath, tip: str | None = None) -> Scenario:
    """A first scenario for a robot's model (MJCF or URDF), written to ``scenario_out``; returns it."""
    command("init", model, scenario_out=scenario_out, tip=tip)
    return Scenario(scenario_out)


def import_table(table: FilePath, mapping: FilePath, measurements_out: FilePath | None = None) -> Results:
    """Reads a table of another program through a mapping of its columns, and writes a measurement file."""
    return command("import", table, mapping=mapping, measurements_out=measurements_out)


def merge(*shards: FilePath, **given: Any) -> Results:
    """Joins the shards of a study."""
    return command("merge", *shards, **given)


def explain(*codes: str) -> Results:
    """What codes of conditions and errors mean, such as "C0102"; all codes if none is given."""
    return command("explain", *codes)


def schema() -> Results:
    """The JSON schema of scenario files."""
    return command("schema")
