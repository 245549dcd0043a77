"""What goes in and comes out: arrays with units in their names."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
FilePath = str | PathLike[str]

WRENCH = ["fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm"]
DEFLECTION = ["dx_mm", "dy_mm", "dz_mm"]


class ElastocalError(Exception):
    """What the command line says after ``error CODE:``; ``hint`` is what it says after ``hint:``, if anything.

    ``code`` is stable, such as "E0101", and ``elastocal explain`` says what it means; None for usage.
    """

    def __init__(self, message: str, hint: str | None = None, code: str | None = None) -> None:
        super().__init__(message)
        self.hint = hint
        self.code = code


class UsageError(ElastocalError):
    """An option that is not there, or a value that it cannot have."""


@dataclass(frozen=True)
class Condition:
    """What must be looked at before results are relied on (exit code 3 on the command line unless ``allowed``).

    ``code`` is stable, such as "C0102", and ``elastocal explain`` says what it means.
    """

    code: str
    text: str
    allowed: bool = False

    def __str__(self) -> str:
        return f"{self.code}{' (allowed)' if self.allowed else ''}: {self.text}"


class Results(dict[str, Any]):
    """A command's record, with the keys that ``--json`` prints.

    ``conditions`` must be looked at before the results are relied on, ``text`` is what the command line prints for a person.
    """

    def __init__(self, record: dict[str, Any], text: str, conditions: list[Condition]) -> None:
        super().__init__(record)
        self.text = text
        self.conditions = conditions


def _array(values: Any, columns: int | None = None) -> Array:
    found = np.array([[np.nan if each is None else each for each in row] for row in values], dtype=float)
    return found.reshape(len(values), columns) if columns is not None else found


def _table(text: str) -> tuple[list[str], Array]:
    """The columns of a CSV that elastocal has written, and its rows."""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    rows = list(csv.reader(io.StringIO("\n".join(lines))))
    return rows[0], np.array(rows[1:], dtype=float).reshape(len(rows) - 1, len(rows[0]))


def _written(columns: list[str], rows: Array) -> str:
    lines = [",".join(columns)]
    lines += [",".join(repr(float(value)) for value in row) for row in rows]
    return "\n".join(lines) + "\n"


@dataclass
class Plan:
    """A plan of m experiments.

    ``q_deg`` (m, n): commanded angles (deg; slides mm). ``wrench`` (m, 6): force (N) and torque (N m) at the calibration
    tool in the world frame. ``repeats`` (m,): how often each is measured.
    """

    q_deg: Array
    wrench: Array
    repeats: NDArray[np.int64]

    def __post_init__(self) -> None:
        self.q_deg = np.atleast_2d(np.asarray(self.q_deg, dtype=float))
        count = len(self.q_deg)
        wrench = np.atleast_2d(np.asarray(self.wrench, dtype=float))
        self.wrench = np.broadcast_to(wrench, (count, 6)).copy()
        repeats = np.asarray(self.repeats, dtype=np.int64)
        self.repeats = np.broadcast_to(repeats, (count,)).copy()

    @classmethod
    def of(cls, q_deg: ArrayLike, wrench: ArrayLike, repeats: ArrayLike = 1) -> Plan:
        """Of arrays; one wrench (6,) or number of repeats does for all experiments."""
        return cls(np.asarray(q_deg, dtype=float), np.asarray(wrench, dtype=float), np.asarray(repeats, dtype=np.int64))

    @classmethod
    def load(cls, path: FilePath) -> Plan:
        """Reads a plan CSV as elastocal writes it."""
        columns, rows = _table(Path(path).read_text(encoding="utf-8"))
        q = [index for index, name in enumerate(columns) if name.startswith("q")]
        wrench = [columns.index(name) for name in WRENCH]
        return cls(rows[:, q], rows[:, wrench], rows[:, columns.index("repeats")].astype(np.int64))

    def csv(self, columns: list[str]) -> str:
        """The text of a plan CSV; ``columns`` names the joints' (``Scenario.columns``)."""
        lines = [",".join([*columns, *WRENCH, "repeats"])]
        for q, wrench, repeats in zip(self.q_deg, self.wrench, self.repeats, strict=True):
            numbers = [repr(float(value)) for value in (*q, *wrench)]
            lines.append(",".join([*numbers, str(int(repeats))]))
        return "\n".join(lines) + "\n"

    def save(self, path: FilePath, columns: list[str] | None = None) -> None:
        """Writes a plan CSV; joints are hinges where ``columns`` are not given."""
        names = columns or [f"q{joint + 1}_deg" for joint in range(self.q_deg.shape[1])]
        Path(path).write_text(self.csv(names), encoding="utf-8")

    @property
    def measurements(self) -> int:
        """The number of measurements, repeats counted."""
        return int(self.repeats.sum())

    @classmethod
    def from_record(cls, record: list[dict[str, Any]]) -> Plan:
        """Of the key ``plan`` of a record."""
        return cls(
            _array([each["q_deg"] for each in record]),
            _array([each["wrench"] or [0.0] * 6 for each in record], 6),
            np.array([each["repeats"] for each in record], dtype=np.int64),
        )


@dataclass
class Measurements:
    """k measured deflections.

    ``columns`` are those of the measurement CSV, ``rows`` (k, columns) its numbers. ``q_deg`` (k, n), ``wrench`` (k, 6) in N
    and N m, ``deflection_mm`` (k, 3): loaded minus unloaded position in the world frame.
    """

    columns: list[str]
    rows: Array
    _text: str | None = field(default=None, repr=False)

    @classmethod
    def of(cls, q_deg: ArrayLike, wrench: ArrayLike, deflection_mm: ArrayLike, columns: list[str] | None = None) -> Measurements:
        """Of arrays; ``columns`` names the joints' where some slide (``Scenario.columns``)."""
        q = np.atleast_2d(np.asarray(q_deg, dtype=float))
        load = np.broadcast_to(np.asarray(wrench, dtype=float), (len(q), 6))
        deflection = np.asarray(deflection_mm, dtype=float).reshape(len(q), 3)
        names = columns or [f"q{joint + 1}_deg" for joint in range(q.shape[1])]
        return cls([*names, *WRENCH, *DEFLECTION], np.hstack([q, load, deflection]))

    @classmethod
    def load(cls, path: FilePath) -> Measurements:
        """Reads a measurement CSV as elastocal writes it."""
        return cls.from_text(Path(path).read_text(encoding="utf-8"))

    @classmethod
    def from_text(cls, text: str) -> Measurements:
        """Of the text of a measurement CSV."""
        columns, rows = _table(text)
        return cls(columns, rows, text)

    def csv(self) -> str:
        """The text of the measurement CSV."""
        return self._text if self._text is not None else _written(self.columns, self.rows)

    def save(self, path: FilePath) -> None:
        """Writes the measurement CSV."""
        Path(path).write_text(self.csv(), encoding="utf-8")

    def _of(self, names: list[str]) -> Array:
        return self.rows[:, [self.columns.index(name) for name in names]]

    @property
    def q_deg(self) -> Array:
        """Commanded angles (k, n), deg; slides mm."""
        return self._of([name for name in self.columns if name.startswith("q")])

    @property
    def wrench(self) -> Array:
        """Loads (k, 6), N and N m, world frame."""
        return self._of(WRENCH)

    @property
    def deflection_mm(self) -> Array:
        """Deflections (k, 3), mm, world frame."""
        return self._of(DEFLECTION)


def _metres(millimetres: float | None) -> float | None:
    return None if millimetres is None else millimetres * 1e-3


@dataclass
class Assessment:
    """The predicted accuracy of a plan; ``results`` is the whole record."""

    results: Results
    #: The rms distance that compensation leaves at the test poses (m); None where it is not determined.
    rho0_m: float | None
    #: No plan of as many measurements is below (m); None where there is no bound.
    lower_bound_rho0_m: float | None
    #: The bound over rho0.
    efficiency: float | None
    #: The standard error that the plan predicts for each parameter (p,), rad/(N m); NaN where not determined. Empty where
    #: accuracy is absolute.
    compliance_std_rad_per_nm: Array

    @classmethod
    def from_results(cls, results: Results) -> Assessment:
        """Of a record of ``evaluate`` or ``plan``; of absolute readings ``results["unknowns"]`` tells all standard errors."""
        errors = [np.nan if each is None else each for each in results.get("compliance_std_rad_per_nm", [])]
        return cls(
            results,
            _metres(results["rho0_mm"]),
            _metres(results["lower_bound_rho0_mm"]),
            results["efficiency"],
            np.array(errors, dtype=float),
        )

    @property
    def conditions(self) -> list[Condition]:
        """What must be looked at."""
        return self.results.conditions


@dataclass
class Design(Assessment):
    """A designed plan with what it predicts."""

    @property
    def plan(self) -> Plan:
        """The plan."""
        return Plan.from_record(self.results["plan"])


@dataclass
class Identified:
    """Identified compliances of p parameters; ``results`` is the whole record."""

    results: Results

    @property
    def names(self) -> list[str]:
        """The parameters' names (p,)."""
        return list(self.results["parameters"])

    def _vector(self, key: str) -> Array:
        return np.array([np.nan if each is None else each for each in self.results[key]], dtype=float)

    @property
    def compliance_rad_per_nm(self) -> Array:
        """Compliances (p,), rad/(N m); NaN where not determined."""
        return self._vector("compliance_rad_per_nm")

    @property
    def compliance_std_rad_per_nm(self) -> Array:
        """Standard errors (p,), rad/(N m); NaN where not determined."""
        return self._vector("compliance_std_rad_per_nm")

    @property
    def covariance(self) -> Array:
        """Covariance (p, p), (rad/(N m))^2; NaN where not determined."""
        return _array(self.results["covariance_rad2_per_n2m2"])

    @property
    def conditions(self) -> list[Condition]:
        """What must be looked at, such as residuals that are too large."""
        return self.results.conditions


@dataclass
class Compensation:
    """Commanded angles at the test poses; ``results`` is the whole record."""

    results: Results

    @property
    def q_commanded_deg(self) -> Array:
        """One row a test pose (poses, n), deg; slides mm."""
        return _array([pose["q_commanded_deg"] for pose in self.results["test_poses"]])

    @property
    def angles_rad(self) -> Array:
        """The same in radians, for robots without slides."""
        return np.radians(self.q_commanded_deg)

    @property
    def residual_m(self) -> Array:
        """What compensation leaves on the virtual robot (poses,), m; not a number where another one was measured."""
        residuals = [pose["residual_mm"] for pose in self.results["test_poses"]]
        return np.array([np.nan if each is None else each * 1e-3 for each in residuals])

    @property
    def conditions(self) -> list[Condition]:
        """What must be looked at."""
        return self.results.conditions
