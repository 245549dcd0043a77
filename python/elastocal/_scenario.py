"""A scenario and what can be done with it."""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from contextlib import contextmanager
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _change
from ._commands import _command, read, takes, whole
from ._data import FilePath, Measurements, Plan, Readings, absolute_plan
from ._errors import ElastocalError, UsageError, write_whole
from ._executor import Executors, merged
from ._executor import study as run_shards
from ._problem import Problem
from ._results import Compensation, Design, Assessment, Identified, Results, Validation

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from . import _options as options

#: What methods take besides a file's path, by the name of the parameter, and how it is made.
TAKEN: dict[str, tuple[tuple[type, ...], str]] = {
    "plan": ((Plan, Design, Validation), "ec.Plan(q_deg, wrench) makes one of arrays, scenario.design() a good one"),
    "measurements": (
        (Measurements, Readings),
        "ec.Measurements(q_deg, wrench, deflection_mm) makes them of arrays, ec.read_table of a data frame",
    ),
    "identified": ((Identified,), "scenario.identify(measurements) returns it"),
}
#: The shards of a study on an executor: enough for some workers, and few enough to be worth their while.
SHARDS = 16
MOST_SHARDS = 1_000_000


@contextmanager
def _folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="elastocal-") as name:
        yield Path(name)


def _gone(folder: Path, results: Results) -> Results:
    """The same results without the sentence that names files in a folder that does not stay."""
    results.text = re.sub(rf" ?[^.\n]*{re.escape(str(folder))}[^\n]*", "", results.text)
    return results


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
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._changes: dict[str, Any] = {}

    @classmethod
    def load(cls, path: FilePath, *, seed: int | None = None, noise_only: bool = False, threads: int | None = None) -> Scenario:
        """Reads and checks a scenario file; raises :class:`ElastocalError` for what is wrong."""
        scenario = cls(path, seed, noise_only, threads)
        if scenario.path.suffix in (".xml", ".urdf"):
            raise UsageError(f"{path} is a robot's model; a scenario is wanted", "ec.init(model, 'robot.toml') writes and returns one")
        scenario.command("check")
        return scenario

    def with_(self, changes: Mapping[str, Any] | None = None, /, **more: Any) -> Scenario:
        """The same scenario with other values: ``with_(sigma_mm=0.02)``.

        A name alone is the key of that name that is least deep; ``with_({"study.experiments": 12})`` names its table, and
        ``with_({"test_pose.0.weight": 2})`` the first of a list. None takes a key out. A wrong key is named with near ones, and
        wrong values raise the :class:`ElastocalError` of the command line. The file stays as it is: the changed one is in a
        folder that goes with the scenario; ``save(path)`` keeps it.
        """
        made = {**(changes or {}), **more}
        folder, path = _change.changed(self.path, made)
        try:
            other = Scenario.load(path, seed=self.seed, noise_only=self.noise_only, threads=self.threads)
        except ElastocalError as error:
            # The file that is wrong is not one that somebody has written.
            raise type(error)(str(error).removeprefix(f"{path}: "), error.hint, error.code) from None
        other._folder, other._changes = folder, self._changes | made
        return other

    def __getstate__(self) -> dict[str, Any]:
        """Without what a process makes anew; a changed scenario with its file."""
        return self.__dict__ | {"_problem": None, "_folder": self._folder and read(self.path)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__ |= state
        if state["_folder"] is not None:
            self._folder, self.path = _change.in_folder(self.path.name, state["_folder"])

    @property
    def table(self) -> dict[str, Any]:
        """What the scenario file says, key by key."""
        return _change.table(self.path)

    def save(self, path: FilePath) -> Scenario:
        """Writes the scenario file, with whole paths of the files that it names, wherever; returns it."""
        _, other = (None, self.path) if self._folder else _change.changed(self.path, {})
        write_whole(path, other.read_text(encoding="utf-8"), (".toml",))
        return Scenario(path, self.seed, self.noise_only, self.threads)

    def __repr__(self) -> str:
        changed = ", ".join(f"{key}={value!r}" if isinstance(value, (int, float, str)) else key for key, value in self._changes.items())
        return f"<Scenario {self.path.name}{f' with {changed}' if changed else ''}>"

    def command(self, name: str, **given: Any) -> Results:
        """Any command of the command line for this scenario, with its options as keywords."""
        return _command(name, self.path, **{"seed": self.seed, "noise_only": self.noise_only, "threads": self.threads} | given)

    @property
    def problem(self) -> Problem:
        """Observation and information matrices, the objective with its gradient, and violations."""
        if self._problem is None:
            self._problem = Problem(self.path, self.noise_only)
        return self._problem

    @property
    def columns(self) -> list[str]:
        """The columns of configurations: ``q1_deg``, or ``q1_mm`` for a slide."""
        return self.problem.columns

    @contextmanager
    def _files(self, plans: Mapping[str, object] | None = None, **values: object) -> Iterator[dict[str, Any]]:
        """Plans (also of designs), measurements and identifications as files that a command reads; paths stay what they are.

        ``plans`` are by names that need not be a file's.
        """
        with _folder() as folder:
            named: dict[str, Any] = {}
            names = [str(name) for name in plans or values]
            for number, (name, value) in enumerate((plans or values).items()):
                kinds, made_by = TAKEN["plan" if plans else name]
                if (value is not None or plans) and not isinstance(value, (str, PathLike, *kinds)):
                    wanted = ", ".join(kind.__name__ for kind in kinds)
                    raise UsageError(f"{name} wants {wanted} or a file's path, not {type(value).__name__}", made_by)
                named[name] = path = folder / f"{number}.{'json' if isinstance(value, Identified) else 'csv'}"
                if isinstance(value, Design) and value.results.get("accuracy") == "absolute":
                    path.write_text(absolute_plan(value.results["plan"], self.columns), encoding="utf-8")
                    continue
                if isinstance(value, (Design, Validation)):
                    value = value.plan
                if isinstance(value, (Plan, Measurements)):
                    value.save(path, self.columns)
                elif isinstance(value, Readings):
                    value.save(path)
                elif isinstance(value, Identified):
                    path.write_text(json.dumps(value.results), encoding="utf-8")
                else:
                    named[name] = value
            try:
                yield named
            except ElastocalError as error:
                # Nobody has written the files in this folder, nor can they be looked at.
                def told(text: str) -> str:
                    return re.sub(rf"{re.escape(str(folder))}/(\d+)\.\w+", lambda found: names[int(found[1])], text)

                hint = error.hint and told(error.hint)
                if "unknown column \"q" in str(error) and isinstance(values.get("measurements"), Readings):
                    hint = f"{hint}; ec.read_table takes a unit for each joint: units={{'joints': ['mm', 'deg', ...]}}"
                raise type(error)(told(str(error)), hint, error.code) from None

    @takes("check")
    def check(self, plan: Plan | Design | FilePath | None = None, **given: Unpack[options.CheckGiven]) -> Results:
        """The robot as it was understood, with ``warnings``; with a plan, ``ok`` and ``problems``."""
        with self._files(plan=plan) as files:
            return self.command("check", **files, **given)

    @takes("plan")
    def design(self, experiments: int | None = None, **given: Unpack[options.PlanGiven]) -> Design:
        """Designs a plan of ``experiments`` measurements (the scenario's if not given).

        Where accuracy is absolute, ``parameters`` are groups of unknowns, and rows are chosen from ``candidates`` or drawn.
        """
        return Design(self.command("plan", experiments=experiments, **given), self)

    @takes("evaluate")
    def evaluate(self, plan: Plan | Design | FilePath, **given: Unpack[options.EvaluateGiven]) -> Assessment:
        """The predicted accuracy of a plan, and the bound that no plan of as many measurements can beat.

        Where accuracy is absolute, a plan that names targets or stations is a design, or a file's path; with ``trials``,
        ``results["trials"]`` says whether virtual robots err as predicted.
        """
        with self._files(plan=plan) as files:
            return Assessment(self.command("evaluate", **files, **given))

    @takes("budget")
    def budget(
        self, accuracy_um: float | None = None, up_to: int | None = None, **given: Unpack[options.BudgetGiven]
    ) -> Results:
        """How many measurements in how many configurations an accuracy (um, rms) takes."""
        return self.command("budget", accuracy_um=accuracy_um, up_to=up_to, **given)

    @takes("measure")
    def measure(self, plan: Plan | Design | Validation | FilePath, **given: Unpack[options.MeasureGiven]) -> Measurements:
        """Measures a plan on the virtual robot of a run in a study, with its random numbers under the seed (run 0 if not given).

        Another run or seed is another robot where the scenario has compliances or errors of the robot vary. ``campaign=1`` reads the
        same robot anew, ``series=1`` in the same campaign. In one call, ``scenario.measure(first + second)`` begins with the numbers of
        ``scenario.measure(first)``; the rest, which is ``[len(measured):]``, has new noise.
        """
        if self.table.get("design", {}).get("accuracy") == "absolute":
            raise UsageError("the scenario's accuracy is absolute: measure_absolute(plan) has readings", "with_(accuracy='relative')")
        return Measurements.from_text(self._measured(plan, dict(given)))

    def _measured(self, plan: Plan | Design | Validation | FilePath, given: dict[str, Any]) -> str:
        with self._files(plan=plan) as files, _folder() as folder:
            out = Path(given.pop("measurements_out", None) or folder / "measurements.csv")
            self.command("measure", **files, measurements_out=out, **given)
            return read(out)

    @takes("measure")
    def measure_absolute(self, plan: Design | FilePath, **given: Unpack[options.MeasureGiven]) -> Readings:
        """Reads a plan of absolute readings on the virtual robot of a run, for :meth:`identify`; accuracy must be absolute.

        Robot, instrument's frames and noise are functions of the seed and of ``run`` (0 if not given), as for :meth:`measure`. Each
        repeat is a reading by itself, with the instrument's standard deviations; the robot's true parameters are not in the table.
        """
        if self.table.get("design", {}).get("accuracy") != "absolute":
            raise UsageError("the scenario's accuracy is relative: measure(plan) has its deflections", "with_(accuracy='absolute')")
        return Readings(self._measured(plan, dict(given)))

    @takes("identify")
    def identify(self, measurements: Measurements | Readings | FilePath, **given: Unpack[options.IdentifyGiven]) -> Identified:
        """Identifies the compliances; ``method`` is ``nonlinear`` or ``linear``, the scenario's if not given.

        Absolute readings are those of :func:`read_table`, or a file's. ``parameters`` are then groups such as ``geometry`` and
        ``compliances``, fitted with all frames; the results' ``unknowns`` and ``stations`` say what came of it. Readings that lie
        far out, deflections too, are left out, unless ``keep_all``.
        """
        with self._files(measurements=measurements) as files:
            return Identified(self.command("identify", **files, **given))

    @takes("select")
    def select(self, measurements: Readings | FilePath, **given: Unpack[options.SelectGiven]) -> Results:
        """Chooses a few of many absolute readings in several ways, calibrates with each choice, and judges on all others."""
        with self._files(measurements=measurements) as files:
            return self.command("select", **files, **given)

    @takes("compensate")
    def compensate(self, identified: Identified | FilePath, **given: Unpack[options.CompensateGiven]) -> Compensation:
        """The angles to command at the test poses, so that the loaded tool stands where it should."""
        with self._files(identified=identified) as files:
            return Compensation(self.command("compensate", **files, **given), self)

    @takes("compensate")
    def compensate_targets(
        self, identified: Identified | FilePath, targets: FilePath, **given: Unpack[options.CompensateGiven]
    ) -> Results:
        """The angles to command for absolute targets of a file."""
        with self._files(identified=identified) as files:
            return self.command("compensate", **files, targets=targets, **given)

    @takes("export")
    def export(self, identified: Identified | FilePath, model_out: FilePath, **given: Unpack[options.ExportGiven]) -> Results:
        """Writes the calibrated robot as a model (MJCF)."""
        with self._files(identified=identified) as files:
            return self.command("export", **files, model_out=model_out, **given)

    @takes("next")
    def next(self, measurements: Measurements | FilePath, plan: Plan | FilePath | None = None, **given: Unpack[options.NextGiven]) -> Results:
        """What to measure next, after some of a plan is measured."""
        with self._files(measurements=measurements, plan=plan) as files:
            return self.command("next", **files, **given)

    @takes("validate")
    def validate(
        self,
        identified: Identified | FilePath,
        measurements: Measurements | Readings | FilePath | None = None,
        **given: Unpack[options.ValidateGiven],
    ) -> Validation:
        """A plan for checking an identification, or, with measurements, whether it errs as it predicts."""
        with self._files(identified=identified, measurements=measurements) as files:
            return Validation(self.command("validate", **files, **given), self)

    @takes("lab")
    def lab(self, plan: Plan | Design | FilePath, out: FilePath, **given: Unpack[options.LabGiven]) -> Results:
        """Run sheet, robot program and table to fill in, in a folder under ``out``."""
        with self._files(plan=plan) as files:
            return self.command("lab", **files, out=out, **given)

    @takes("study")
    def study(
        self,
        *,
        plans: Mapping[str, Plan | Design | FilePath] | None = None,
        out: FilePath | None = None,
        executor: Executors | None = None,
        shards: int | None = None,
        tallies: FilePath | None = None,
        **given: Unpack[options.StudyGiven],
    ) -> Results:
        """Compares the scenario's plans over many runs, or ``plans``: by name a :class:`Plan`, its file, or "optimal", "random_each"
        and what else is a ``kind`` of ``[[study.plan]]``. Without ``out`` no file stays.

        With an ``executor``, any of :mod:`concurrent.futures` or a function that makes one, the study is made in ``shards`` (16 if
        not given) by its workers, each with ``threads`` (one if not given), to the same bits. Files that the scenario names are sent
        along. A shard whose worker is lost is made again; with ``tallies``, a folder, shards that are made stay there, and the same
        call goes on from them.
        """
        if plans is not None:
            if not isinstance(plans, Mapping):
                raise UsageError(f"plans are a dict of plans by name, not a {type(plans).__name__}", "plans={'own': plan, 'random': 'random_each'}")
            with self._files(plans) as files:
                listed = [{"name": name, **_study_plan(path)} for name, path in files.items()]
                other = self.with_({"study.plan": listed})
                return other.study(out=out, executor=executor, shards=shards, tallies=tallies, **given)
        if executor is None:
            if shards is not None or tallies is not None:
                raise UsageError("shards and tallies are for a study on an executor; `shard` makes one part")
            return self._into("study", out, dict(given))
        if not (isinstance(executor, Executor) or callable(executor)):
            hint = "of a Dask client it is client.get_executor(pure=False)"
            raise UsageError(f"executor is one of concurrent.futures, or a function that makes one, not a {type(executor).__name__}", hint)
        own = {"seed": self.seed, "noise_only": self.noise_only, "threads": 1 if self.threads is None else self.threads}
        with _folder() as folder:
            kept = folder / "tallies" if tallies is None else Path(tallies)
            count = SHARDS if shards is None else whole("shards", shards, MOST_SHARDS)
            files_of_shards = run_shards(self.path, executor, count, kept, own | given)
            if out is not None:
                return merged(files_of_shards, out)
            return _gone(folder, merged(files_of_shards, folder))

    @takes("run")
    def run(self, *, out: FilePath | None = None, **given: Unpack[options.RunGiven]) -> Results:
        """The whole loop: design, measure, identify, compensate, beside other plans. Without ``out`` no file stays."""
        return self._into("run", out, dict(given))

    @takes("replay")
    def replay(self, run: int, *, out: FilePath | None = None, **given: Unpack[options.ReplayGiven]) -> Results:
        """One run of the study on the virtual robot."""
        return self._into("replay", out, {"run": run, **given})

    @takes("reproduce")
    def reproduce(self, *, out: FilePath | None = None, **given: Unpack[options.ReproduceGiven]) -> Results:
        """The paper's numbers beside this program's."""
        return self._into("reproduce", out, dict(given))

    def _into(self, name: str, out: FilePath | None, given: dict[str, Any]) -> Results:
        if out is not None:
            return self.command(name, out=out, **given)
        with _folder() as folder:
            return _gone(folder, self.command(name, out=folder, **given))


def _study_plan(plan: object) -> dict[str, str]:
    is_kind = isinstance(plan, str) and "." not in plan and "/" not in plan
    return {"kind": str(plan)} if is_kind else {"kind": "file", "file": str(Path(str(plan)).resolve())}


@takes("compare")
def compare(base: FilePath, new: FilePath, **given: Unpack[options.CompareGiven]) -> Results:
    """Two results files against tolerances."""
    return _command("compare", base, new, **given)


@takes("init")
def init(model: FilePath, scenario_out: FilePath, **given: Unpack[options.InitGiven]) -> Scenario:
    """A first scenario for a robot's model (MJCF or URDF), written to ``scenario_out``; returns it."""
    _command("init", model, scenario_out=scenario_out, **given)
    return Scenario(scenario_out)


@takes("import")
def import_table(table: FilePath, mapping: FilePath, **given: Unpack[options.ImportGiven]) -> Results:
    """Reads a table of another program through a mapping of its columns, and writes a measurement file."""
    return _command("import", table, mapping=mapping, **given)


@takes("merge")
def merge(*shards: FilePath, **given: Unpack[options.MergeGiven]) -> Results:
    """Joins the shards of a study."""
    return _command("merge", *shards, **given)


@takes("explain")
def explain(*codes: str, **given: Unpack[options.ExplainGiven]) -> Results:
    """What codes of conditions and errors mean, such as "C0102"; all codes if none is given."""
    return _command("explain", *codes, **given)


def schema() -> Results:
    """The JSON schema of scenario files."""
    return _command("schema")
