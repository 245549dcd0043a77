"""What goes in: plans and measurements as arrays, checked when they are made."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _views
from ._errors import UsageError, write_whole

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
FilePath = str | PathLike[str]
Unit = Literal["deg", "rad"]
#: An array with what is masked in it; not every NumPy says what types it has.
MASKED: Any = np.ma.MaskedArray

#: Files of tables.
TABLES = (".csv",)
WRENCH = ["fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm"]
DEFLECTION = ["dx_mm", "dy_mm", "dz_mm"]
#: What a gauge reads along, and what it shows.
DIRECTION = ["direction_x", "direction_y", "direction_z"]
DISPLACEMENT = ["displacement_mm"]
#: Columns of words.
WORDS = ["approach", "station", "target"]
#: No joint of a robot turns further than two turns (rad): what is larger is in degrees.
MOST_RAD = 4 * np.pi
#: Where no angle of several configurations is larger (deg), they are in radians: plans spread over the joints' ranges.
LEAST_DEG = 2 * np.pi


def numbers(name: str, values: ArrayLike, columns: Sequence[str] | None = None) -> Array:
    """Rows of finite numbers, (k, columns); raises :class:`UsageError` for anything else."""
    try:
        if np.iscomplexobj(values):
            raise TypeError("found complex ones")
        given = MASKED(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{name} wants rows of numbers, all of one length: {error}") from None
    # What is masked is not there.
    found = np.atleast_2d(np.array(given.filled(np.nan)))
    shape = f"{name} has the shape {np.shape(values)}"
    if found.ndim != 2 or found.size == 0:
        raise UsageError(f"{shape}; one row of numbers for each configuration is wanted")
    if columns is not None and found.shape[1] != len(columns):
        is_turned = found.shape[0] == len(columns)
        hint = f"{name}.T has rows of {len(columns)}" if is_turned else f"a row is {', '.join(columns)}"
        raise UsageError(f"{shape}; rows of {len(columns)} are wanted", hint)
    wrong = np.argwhere(~np.isfinite(found))
    if len(wrong):
        row, column = wrong[0]
        each = given.reshape(found.shape)[row, column]
        what = "a masked value" if each is np.ma.masked else each
        raise UsageError(f"{name} has {what} in row {row}, column {column}; finite numbers are wanted")
    return found


def for_each(name: str, rows: Array, count: int) -> Array:
    """A row for each configuration: one row does for all."""
    if len(rows) not in (1, count):
        raise UsageError(f"{name} has {len(rows)} rows, and q_deg has {count}", "give as many, or one for all")
    return np.broadcast_to(rows, (count, rows.shape[1])).copy()


def angles(values: ArrayLike, unit: Unit | None, columns: Sequence[str] | None = None) -> Array:
    """Configurations in degrees; raises :class:`UsageError` where they can only be in another unit than is said.

    Where ``columns`` say that a joint slides, its values are in mm; in m with ``unit="rad"``.
    """
    found = numbers("q_deg", values, columns)
    wrong = set(columns or ()) - set(of_joints(columns or ()))
    if wrong:
        raise UsageError(f"columns are q1_deg, or q1_mm of a slide, and so on, not {min(wrong)!r}", "columns=scenario.columns names them")
    slides = np.array([name.endswith("_mm") for name in columns or joints(found.shape[1])])
    turning = found[:, ~slides]
    largest = float(np.abs(turning).max(initial=0))
    if unit not in (None, "deg", "rad"):
        raise UsageError(f"unit is 'deg' or 'rad', not {unit!r}")
    if unit == "rad":
        if largest > MOST_RAD:
            raise UsageError(f"q_deg with unit='rad' has an angle of {largest:g} rad: these are degrees", "leave unit='rad' out")
        return np.where(slides, 1e3 * found, np.degrees(found))
    if unit is None and turning.size >= 6 and 0 < largest <= LEAST_DEG:
        hint = "unit='rad' converts them; if they are degrees, unit='deg' says so"
        raise UsageError(f"q_deg has no angle above {largest:.3g} in {len(found)} configurations: these are radians", hint)
    return found


def _table(text: str, wanted: Sequence[str], what: str) -> tuple[list[str], list[list[str]]]:
    """The columns of a CSV that elastocal has written, and its rows."""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    rows = list(csv.reader(io.StringIO("\n".join(lines)))) or [[]]
    missing = [name for name in wanted if name not in rows[0]]
    if missing or "target" in rows[0]:
        hint = "methods take files of absolute readings, and of plans of them, by their paths" if "target" in rows[0] else None
        has = ", ".join(rows[0]) or "no columns"
        raise UsageError(f"{what} has the columns q1_deg and so on, {', '.join(wanted)}; found {has}", hint)
    return rows[0], rows[1:]


def _columns(table: tuple[list[str], list[list[str]]], names: Sequence[str], what: str) -> Array:
    """The numbers of some columns of a table; not a number where a cell is empty."""
    columns, rows = table
    places = [columns.index(name) for name in names]
    try:
        found = [[float(row[place] or "nan") for place in places] for row in rows]
    except (ValueError, IndexError) as error:
        raise UsageError(f"{what} wants numbers in {', '.join(names)}: {error}") from None
    return np.array(found, dtype=float).reshape(len(rows), len(names))


def _written(columns: list[str], rows: Array) -> str:
    lines = [",".join(columns)]
    lines += [",".join("" if np.isnan(value) else repr(float(value)) for value in row) for row in rows]
    return "\n".join(lines) + "\n"


def joints(count: int) -> list[str]:
    """The columns of as many hinges."""
    return [f"q{joint + 1}_deg" for joint in range(count)]


def of_joints(columns: Sequence[str]) -> list[str]:
    """The columns that are joints', in the order of the joints."""
    found = [name for name in columns if re.fullmatch(r"q\d+_(deg|mm)", name)]
    return sorted(found, key=lambda name: int(name[1:].split("_")[0]))


def named(what: str, count: int, own: list[str] | None, columns: list[str] | None) -> list[str]:
    """The joints' columns of a table: those of a robot, ``columns``; without a robot its ``own``, or hinges'.

    Raises :class:`UsageError` where a table with so many joints, or with columns of its own, is not of that robot.
    """
    if columns is None:
        return own or joints(count)
    has = ", ".join(columns)
    if count != len(columns):
        raise UsageError(f"{what} has {count} columns of angles; the robot has {len(columns)} commanded joints: {has}")
    if own is not None and own != columns:
        hint = "columns=scenario.columns names them; with unit='rad' slides are then in m"
        raise UsageError(f"{what} has the columns {', '.join(own)}; those of the robot are {has}", hint)
    return columns


def _known(columns: Sequence[str] | None, unit: Unit | None, count: int) -> list[str] | None:
    """The joints' columns; None where they are the robot's, whatever it is: what was in rad is of hinges unless columns say else."""
    return list(columns) if columns else joints(count) if unit == "rad" else None


class Experiment(NamedTuple):
    """A row of a plan."""

    q_deg: Array
    wrench: Array
    repeats: int


class Plan:
    """A plan of m experiments.

    ``q_deg`` (m, n): commanded angles (deg; slides mm; with ``unit="rad"`` they are given in rad, and slides, which ``columns`` then
    must name, in m). ``wrench`` (m, 6), or (6,) for all: force (N) and torque (N m) at the calibration tool in the world frame.
    ``repeats`` (m,), or one number: how often each is measured. ``columns`` names the joints' (``Scenario.columns``).
    ``direction`` (m, 3), or (3,) for all: what a gauge reads along, not a number where positions are read. ``approach``: the side of
    each joint, such as ``"+-+-+-"``, of each experiment or one for all.
    """

    def __init__(
        self,
        q_deg: ArrayLike,
        wrench: ArrayLike,
        repeats: ArrayLike = 1,
        *,
        unit: Unit | None = None,
        columns: Sequence[str] | None = None,
        direction: ArrayLike | None = None,
        approach: str | Sequence[str] | None = None,
    ) -> None:
        self.q_deg: Array = angles(q_deg, unit, columns)
        self._joints = _known(columns, unit, self.q_deg.shape[1])
        count = len(self.q_deg)
        self.wrench: Array = for_each("wrench", numbers("wrench", wrench, WRENCH), count)
        often = numbers("repeats", MASKED(repeats).reshape(-1, 1))
        if (often < 1).any() or (often % 1 != 0).any():
            raise UsageError("repeats are whole numbers from 1 on", "an experiment that is not made has no row")
        self.repeats: NDArray[np.int64] = for_each("repeats", often, count)[:, 0].astype(np.int64)
        self.direction: Array | None = None
        if direction is not None:
            along = np.atleast_2d(np.asarray(direction, dtype=float))
            if along.shape[1] != 3:
                raise UsageError(f"direction has the shape {np.shape(direction)}; rows of 3 are wanted")
            self.direction = for_each("direction", along, count)
        self.approach: list[str] = [approach] * count if isinstance(approach, str) else list(approach or [])
        if self.approach and len(self.approach) != count:
            raise UsageError(f"approach has {len(self.approach)} sides, and q_deg has {count} rows", "give as many, or one for all")

    @classmethod
    def load(cls, path: FilePath) -> Plan:
        """Reads a plan CSV as elastocal writes it."""
        what = f"{path}: a plan"
        table = _table(Path(path).read_text(encoding="utf-8"), [*WRENCH, "repeats"], what)
        columns, rows = table
        own = of_joints(columns)
        q, wrench, repeats = (_columns(table, names, what) for names in (own, WRENCH, ["repeats"]))
        direction = _columns(table, DIRECTION, what) if DIRECTION[0] in columns else None
        approach = [row[columns.index("approach")] for row in rows] if "approach" in columns else None
        return cls(q, wrench, repeats[:, 0], unit="deg", columns=own, direction=direction, approach=approach)

    @classmethod
    def from_record(cls, record: list[dict[str, Any]], columns: list[str] | None = None) -> Plan:
        """Of the key ``plan`` of a record, with a robot's columns of joints."""
        return cls(
            [each["q_deg"] for each in record],
            [each["wrench"] or [0.0] * 6 for each in record],
            [each["repeats"] for each in record],
            unit="deg",
            columns=columns,
            direction=[each.get("direction") or [np.nan] * 3 for each in record] if any("direction" in each for each in record) else None,
            approach=[each.get("approach") or "" for each in record] if any("approach" in each for each in record) else None,
        )

    def _named(self, columns: list[str] | None = None) -> list[str]:
        return named("the plan", self.q_deg.shape[1], self._joints, columns)

    def csv(self, columns: list[str] | None = None) -> str:
        """The text of a plan CSV; ``columns`` names the joints' (``Scenario.columns``), which are hinges if nothing does."""
        along = DIRECTION if self.direction is not None else []
        lines = [",".join([*self._named(columns), *WRENCH, *along, "repeats", *(["approach"] if self.approach else [])])]
        for row, (q, wrench, repeats) in enumerate(self):
            direction = [] if self.direction is None else self.direction[row]
            cells = ["" if np.isnan(value) else repr(float(value)) for value in (*q, *wrench, *direction)]
            lines.append(",".join([*cells, str(repeats), *self.approach[row : row + 1]]))
        return "\n".join(lines) + "\n"

    def save(self, path: FilePath, columns: list[str] | None = None) -> None:
        """Writes a plan CSV; ``columns`` as in :meth:`csv`."""
        write_whole(path, self.csv(columns), TABLES)

    @property
    def measurements(self) -> int:
        """The number of measurements, repeats counted."""
        return int(self.repeats.sum())

    def __len__(self) -> int:
        return len(self.q_deg)

    def __iter__(self) -> Iterator[Experiment]:
        for q, wrench, repeats in zip(self.q_deg, self.wrench, self.repeats, strict=True):
            yield Experiment(q, wrench, int(repeats))

    def __getitem__(self, rows: int | slice | Sequence[int]) -> Plan:
        """Some of the experiments, as a plan."""
        chosen = [rows] if isinstance(rows, int) else rows
        approach = [str(side) for side in np.array(self.approach)[chosen]] if self.approach else None
        direction = None if self.direction is None else self.direction[chosen]
        its = (self.q_deg[chosen], self.wrench[chosen], self.repeats[chosen])
        return Plan(*its, unit="deg", columns=self._joints, direction=direction, approach=approach)

    def __add__(self, other: Plan) -> Plan:
        """This plan, and then another."""
        mine, its = self.q_deg.shape[1], other.q_deg.shape[1]
        if mine != its:
            raise UsageError(f"the plans have {mine} and {its} joints")
        if self._joints and other._joints and self._joints != other._joints:
            columns = " and ".join(", ".join(each) for each in (self._joints, other._joints))
            raise UsageError(f"the plans have the columns {columns}", "columns=scenario.columns names those of the robot")
        own = self._joints or other._joints
        both = ([getattr(self, name), getattr(other, name)] for name in ("q_deg", "wrench", "repeats"))
        along = [np.full((len(each), 3), np.nan) if each.direction is None else each.direction for each in (self, other)]
        has = self.direction is not None or other.direction is not None
        sides = [side for each in (self, other) for side in each.approach or [""] * len(each)]
        q, wrench, repeats = map(np.concatenate, both)
        direction = np.concatenate(along) if has else None
        return Plan(q, wrench, repeats, unit="deg", columns=own, direction=direction, approach=sides if any(sides) else None)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Plan)
            and all(np.array_equal(getattr(self, name), getattr(other, name)) for name in ("q_deg", "wrench", "repeats", "approach"))
            and (self.direction is None) == (other.direction is None)
            and (self.direction is None or np.array_equal(self.direction, np.asarray(other.direction), equal_nan=True))
        )

    def __repr__(self) -> str:
        repeated = "" if self.measurements == len(self) else f", {self.measurements} measurements"
        return f"<Plan: {_views.counted(len(self), 'experiment')}{repeated}, {self.q_deg.shape[1]} joints>"

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each experiment, with the columns of the plan CSV."""
        rows = np.column_stack([self.q_deg, self.wrench])
        return _views.frame(rows, [*self._named(), *WRENCH]).assign(repeats=self.repeats)

    def _repr_html_(self) -> str:
        rows = [[*(f"{value:.2f}" for value in q), *(f"{value:g}" for value in wrench), repeats] for q, wrench, repeats in self]
        return _views.html(repr(self)[1:-1], [*self._named(), *WRENCH, "repeats"], rows)

    def plot(self, axes: Axes | None = None) -> Axes:
        """The experiments' angles, joint by joint."""
        return _views.plot_plan(self.q_deg, axes)


def absolute_plan(rows: list[dict[str, Any]], columns: list[str]) -> str:
    """The text of a CSV of a plan of absolute readings, of the key ``plan`` of a record."""
    words = [name for name in ("target", "station", "approach") if any(row.get(name) for row in rows)]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*columns, *WRENCH, "repeats", *words])
    for row in rows:
        writer.writerow([*row["q_deg"], *(row["wrench"] or [0.0] * 6), row["repeats"], *(row.get(name) or "" for name in words)])
    return text.getvalue()


class Measurements:
    """k measured deflections.

    ``q_deg`` (k, n): commanded angles (deg; slides mm; with ``unit="rad"`` they are given in rad, and slides, which ``columns`` then
    must name, in m). ``wrench`` (k, 6) in N and N m, or (6,) for all; ``deflection_mm`` (k, 3): loaded minus unloaded position in
    the world frame. ``columns`` names the joints' (``Scenario.columns``).

    ``columns`` are then those of the measurement CSV, ``rows`` (k, columns) its numbers.
    """

    def __init__(
        self,
        q_deg: ArrayLike,
        wrench: ArrayLike,
        deflection_mm: ArrayLike,
        columns: Sequence[str] | None = None,
        *,
        unit: Unit | None = None,
    ) -> None:
        q = angles(q_deg, unit, columns)
        load = for_each("wrench", numbers("wrench", wrench, WRENCH), len(q))
        deflection = numbers("deflection_mm", deflection_mm, DEFLECTION)
        if len(deflection) != len(q):
            raise UsageError(f"deflection_mm has {len(deflection)} rows, and q_deg has {len(q)}", "each deflection has its row")
        self._joints = _known(columns, unit, q.shape[1])
        self.columns: list[str] = [*(columns or joints(q.shape[1])), *WRENCH, *DEFLECTION]
        self.rows: Array = np.hstack([q, load, deflection])
        self._text: str | None = None

    @classmethod
    def load(cls, path: FilePath) -> Measurements:
        """Reads a measurement CSV as elastocal writes it."""
        return cls.from_text(Path(path).read_text(encoding="utf-8"), f"{path}: a table of measurements")

    @classmethod
    def from_text(cls, text: str, what: str = "a table of measurements") -> Measurements:
        """Of the text of a measurement CSV; messages say ``what`` it is."""
        made = cls.__new__(cls)
        reads = DISPLACEMENT if DISPLACEMENT[0] in text else DEFLECTION
        table = _table(text, [*WRENCH, *reads], what)
        made.columns = [name for name in table[0] if name not in WORDS]
        made.rows = _columns(table, made.columns, what)
        made._text, made._joints = text, of_joints(made.columns)
        return made

    def csv(self, columns: list[str] | None = None) -> str:
        """The text of the measurement CSV; ``columns`` names the joints' (``Scenario.columns``), which are hinges if nothing does."""
        its = named("the table of measurements", len(of_joints(self.columns)), self._joints, columns)
        return self._text if self._text is not None else _written([*its, *WRENCH, *DEFLECTION], self.rows)

    def save(self, path: FilePath, columns: list[str] | None = None) -> None:
        """Writes the measurement CSV; ``columns`` as in :meth:`csv`."""
        write_whole(path, self.csv(columns), TABLES)

    def _of(self, names: list[str]) -> Array:
        return self.rows[:, [self.columns.index(name) for name in names]]

    @property
    def q_deg(self) -> Array:
        """Commanded angles (k, n), deg; slides mm."""
        return self._of(of_joints(self.columns))

    @property
    def wrench(self) -> Array:
        """Loads (k, 6), N and N m, world frame."""
        return self._of(WRENCH)

    @property
    def deflection_mm(self) -> Array:
        """Deflections (k, 3), mm, world frame."""
        if DEFLECTION[0] not in self.columns:
            raise UsageError("a gauge's table has no deflections", "displacement_mm is what the gauge shows")
        return self._of(DEFLECTION)

    @property
    def displacement_mm(self) -> Array:
        """What a gauge shows (k,), mm, along its direction; not a number where positions are read."""
        if DISPLACEMENT[0] not in self.columns:
            raise UsageError("the table has no displacements", "deflection_mm is what was read")
        return self._of(DISPLACEMENT)[:, 0]

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, rows: int | slice | Sequence[int]) -> Measurements:
        """Some of the measurements."""
        chosen = [rows] if isinstance(rows, int) else rows
        made = Measurements.__new__(Measurements)
        made.columns, made.rows, made._text, made._joints = self.columns, self.rows[chosen], None, self._joints
        if self._text is not None:
            # Where they come from stays with them.
            said = "".join(f"{line}\n" for line in self._text.splitlines() if line.startswith("#"))
            made._text = said + _written(made.columns, made.rows)
        return made

    def __repr__(self) -> str:
        if not len(self):
            return "<Measurements: none>"
        is_gauge = DEFLECTION[0] not in self.columns
        size = np.linalg.norm(self._of(DISPLACEMENT if is_gauge else DEFLECTION), axis=1)
        counted = _views.counted(len(self), "displacement" if is_gauge else "deflection")
        return f"<Measurements: {counted} of {np.nanmin(size):.3g} to {np.nanmax(size):.3g} mm>"

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each measurement, with the columns of the measurement CSV."""
        return _views.frame(self.rows, self.columns)

    def _repr_html_(self) -> str:
        return _views.html(repr(self)[1:-1], self.columns, [[f"{value:.6g}" for value in row] for row in self.rows])


class Readings:
    """Absolute readings of positions or poses, as :func:`read_table` makes them of a data frame."""

    def __init__(self, text: str) -> None:
        self._text = text

    def csv(self) -> str:
        """The text of the measurement CSV."""
        return self._text

    def save(self, path: FilePath) -> None:
        """Writes the measurement CSV."""
        write_whole(path, self._text, TABLES)

    def _lines(self) -> list[list[str]]:
        return list(csv.reader(line for line in self._text.splitlines() if line and not line.startswith("#")))

    def __len__(self) -> int:
        return len(self._lines()) - 1

    def __repr__(self) -> str:
        kind = "poses" if any(name in ("qw", "rx_mrad") for name in self._lines()[0]) else "positions"
        return f"<Readings: {len(self)} {kind}>"

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each reading, with the columns of the measurement CSV."""
        return _views.frame_of_csv(self._text)

    def _repr_html_(self) -> str:
        head, *rows = self._lines()
        return _views.html(repr(self)[1:-1], head, rows)
