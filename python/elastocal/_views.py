"""What results look like: in a notebook, as a data frame (pandas), as a picture (Matplotlib)."""

from __future__ import annotations

import html as escaping
import importlib
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._errors import UsageError, nearest

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

#: What a command is about: a list of its record, and what its rows are.
LISTS = {
    "budget": ("budget", "plan"),
    "compensate": ("test_poses", "test pose"),
    "evaluate": ("uncertainty_budget.sources", "error source"),
    "identify": ("unknowns", "unknown"),
    "next": ("plan", "experiment"),
    "plan": ("plan", "experiment"),
    "run": ("plans", "plan"),
    "study": ("plans", "plan"),
    "merge": ("plans", "plan"),
    "validate": ("measurements", "measurement"),
}
#: Rows that a page shows of a long table.
SHOWN = 60
#: Columns that stand first in a table.
FIRST = ["name", "value", "standard_error", "unit"]
#: What a validation with absolute readings compares.
ROBOTS = {"before": "nominal", "": "identified", "with_joint_errors": "with joint errors"}


def counted(count: int, what: str) -> str:
    """1 plan, 2 plans."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def _import(name: str, extra: str, what: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"{what} needs {name.split('.')[0]}: pip install 'elastocal[{extra}]'") from error


# Records as tables.


def rows(record: Mapping[str, Any], key: str) -> list[Any]:
    """The list under a key such as "uncertainty_budget.sources"; none where it is not there."""
    found: Any = record
    for each in key.split("."):
        found = found.get(each) if isinstance(found, Mapping) else None
    return found if isinstance(found, list) else []


def lists(record: Mapping[str, Any], above: str = "") -> list[str]:
    """The keys of all lists of objects."""
    found = []
    for key, value in record.items():
        if isinstance(value, Mapping):
            found += lists(value, f"{above}{key}.")
        elif isinstance(value, list) and value and all(isinstance(each, Mapping) for each in value):
            found.append(above + key)
    return found


def listed(record: Any) -> str | None:
    """The list that a record is about; None where there is none."""
    key, _ = LISTS.get(record.command, (None, ""))
    if key is not None and rows(record, key):
        return key
    there = [each for each in lists(record) if each != "conditions"]
    return "plan" if "plan" in there else there[0] if len(there) == 1 else None


def frame(values: Any, columns: Sequence[str]) -> pd.DataFrame:
    """A data frame of rows."""
    made: pd.DataFrame = _import("pandas", "notebook", "to_dataframe").DataFrame(values, columns=list(columns))
    return made


def frame_of_csv(text: str) -> pd.DataFrame:
    """A data frame of a CSV that elastocal has written."""
    pandas = _import("pandas", "notebook", "to_dataframe")
    made: pd.DataFrame = pandas.read_csv(io.StringIO(text), comment="#")
    return made


def is_of_absolute_readings(record: Any) -> bool:
    """Whether it is a validation with absolute readings."""
    return record.command == "validate" and bool(record.get("residuals_mm"))


def distances_mm(record: Any) -> dict[str, dict[str, float]]:
    """How far each robot is from absolute readings."""
    robots = {name: record.get(place) if place else record for place, name in ROBOTS.items()}
    return {name: each["distance_mm"] for name, each in robots.items() if each}


def frame_of_record(record: Any, key: str | None) -> pd.DataFrame:
    """What the record is about, or the list of objects under a key."""
    pandas = _import("pandas", "notebook", "to_dataframe")
    if key is None and record.command == "identify" and record.get("compliance_rad_per_nm"):
        values = {name: record[name] for name in ("compliance_rad_per_nm", "compliance_std_rad_per_nm")}
        made: pd.DataFrame = pandas.DataFrame(values, index=pandas.Index(record["parameters"], name="parameter"), dtype=float)
        return made
    if key is None and is_of_absolute_readings(record):
        table: pd.DataFrame = pandas.DataFrame(distances_mm(record)).T
        return table[["mean", "rms", "quantile95", "largest"]].add_suffix("_mm")
    there = lists(record)
    chosen = key or listed(record)
    if chosen not in there:
        what = f"no list {key!r}" if key else "several lists, and none that it is about"
        hint = key and nearest(key, there)
        raise UsageError(f"the record has {what}; it has: {', '.join(there) or 'none'}", hint or None)
    made = pandas.json_normalize(rows(record, chosen))
    first = [name for name in FIRST if name in made]
    made = made[[*first, *made.columns.difference(first, sort=False)]]
    return made


# Pages of notebooks.


def html(title: str, columns: Iterable[str], lines: Sequence[Sequence[object]]) -> str:
    """A table of a notebook."""
    head = "".join(f"<th>{escaping.escape(str(each))}</th>" for each in columns)
    body = "".join(
        f"<tr>{''.join(f'<td>{escaping.escape(str(each))}</td>' for each in line)}</tr>" for line in lines[:SHOWN]
    )
    more = f"<p>... {len(lines) - SHOWN} more</p>" if len(lines) > SHOWN else ""
    return f"<p>{escaping.escape(title)}</p><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"


def html_text(text: str, conditions: Sequence[str]) -> str:
    """What the command line prints, with what must be looked at before it."""
    said = "".join(f"<p><b>{escaping.escape(each)}</b></p>" for each in conditions)
    return f"{said}<pre>{escaping.escape(text.rstrip())}</pre>"


# Pictures. Each takes the axes of a picture that is there, or makes one, and returns the axes.


def _axes(axes: Axes | None) -> Axes:
    if axes is None:
        _, made = _import("matplotlib.pyplot", "notebook", "plot").subplots(figsize=(7, 4), layout="constrained")
        axes = made
    return axes


def plot_plan(q_deg: Array, axes: Axes | None) -> Axes:
    """A plan's angles, joint by joint."""
    axes = _axes(axes)
    names = [f"q{joint + 1}" for joint in range(q_deg.shape[1])]
    for number, q in enumerate(q_deg, 1):
        axes.plot(names, q, "o-", label=str(number), linewidth=0.8)
    axes.set_ylabel("angle [deg]")
    if len(q_deg) <= 12:
        axes.legend(title="experiment", fontsize="small")
    return axes


def _plan(record: Any, axes: Axes | None) -> Axes:
    return plot_plan(np.array([each["q_deg"] for each in record["plan"]], dtype=float), axes)


def _study(record: Any, axes: Axes | None) -> Axes:
    plans = [each for each in record["plans"] if each.get("mean_mm") is not None]
    means = 1e3 * np.array([each["mean_mm"] for each in plans])
    ends = 1e3 * np.array([each["mean_ci95_mm"] for each in plans], dtype=float)
    axes = _axes(axes)
    axes.bar([each["name"] for each in plans], means, yerr=np.abs(ends.T - means), color="#4477aa", capsize=3)
    axes.set_ylabel("mean distance after compensation [µm]")
    return axes


def _residuals(record: Any, axes: Axes | None) -> Axes:
    axes = _axes(axes)
    lengths = np.linalg.norm(np.array(record["residuals_mm"], dtype=float), axis=1)
    axes.hist(lengths, bins=40, range=(0.0, 2.0 * np.nanquantile(lengths, 0.95)), color="#4477aa")
    axes.axvline(record["distance_mm"]["mean"], color="#888888", linestyle="--", label="mean of those fitted")
    axes.set_xlabel("distance after the fit [mm]")
    axes.set_ylabel("readings")
    axes.legend()
    return axes


def _identified(record: Any, axes: Axes | None) -> Axes:
    if not record.get("compliance_rad_per_nm"):
        return _residuals(record, axes)
    axes = _axes(axes)
    values, errors = (np.array(record[key], dtype=float) for key in ("compliance_rad_per_nm", "compliance_std_rad_per_nm"))
    axes.errorbar(record["parameters"], 1e6 * values, 1.96e6 * errors, fmt="o", capsize=4, label="identified, 95 %")
    if nominal := record.get("compliance_typical_rad_per_nm"):
        axes.plot(record["parameters"], 1e6 * np.array(nominal, dtype=float), "x", color="#888888", label="nominal")
    axes.set_ylabel("compliance [µrad/(N m)]")
    axes.legend()
    return axes


def _sources(record: Any, axes: Axes | None) -> Axes:
    sources = sorted(rows(record, "uncertainty_budget.sources"), key=lambda each: each["contribution_um"])
    axes = _axes(axes)
    axes.barh([each["source"] for each in sources], [each["contribution_um"] for each in sources], color="#4477aa")
    axes.set_xlabel("contribution to rho0 [µm]")
    return axes


def _budget(record: Any, axes: Axes | None) -> Axes:
    best: dict[int, float] = {}
    for each in record["budget"]:
        if each["rho0_mm"] is not None:
            best[each["experiments"]] = min(1e3 * each["rho0_mm"], best.get(each["experiments"], np.inf))
    axes = _axes(axes)
    axes.plot(list(best), list(best.values()), "o-")
    axes.axhline(record["accuracy_um"], color="#888888", linestyle="--", label="wanted")
    axes.set_xlabel("measurements")
    axes.set_ylabel("rho0 [µm]")
    axes.legend()
    return axes


def _compensated(record: Any, axes: Axes | None) -> Axes:
    poses = record["test_poses"]
    axes = _axes(axes)
    for key, label, shift in [("uncompensated_mm", "without compensation", -0.2), ("residual_mm", "with compensation", 0.2)]:
        values = [np.nan if each[key] is None else 1e3 * each[key] for each in poses]
        axes.bar(np.arange(len(poses)) + shift, values, 0.4, label=label)
    axes.set_xticks(range(len(poses)), [each["name"] for each in poses])
    axes.set_yscale("log")
    axes.set_ylabel("distance [µm]")
    axes.legend()
    return axes


def _validated(record: Any, axes: Axes | None) -> Axes:
    if is_of_absolute_readings(record):
        robots = distances_mm(record)
        axes = _axes(axes)
        axes.bar(list(robots), [each["mean"] for each in robots.values()], color="#4477aa", label="mean")
        axes.plot(list(robots), [each["quantile95"] for each in robots.values()], "k_", markersize=18, label="95 % are below")
        axes.set_ylabel("distance from readings [mm]")
        axes.legend()
        return axes
    checked = record.get("measurements") or []
    if not (checked and "residual_rms_mm" in checked[0]):
        return _plan(record, axes) if record.get("plan") else _refuse(record)
    axes = _axes(axes)
    number = [each["measurement"] for each in checked]
    axes.bar(number, [1e3 * each["residual_rms_mm"] for each in checked], color="#4477aa", label="observed")
    axes.plot(number, [1e3 * each["predicted_rms_mm"] for each in checked], "k_", markersize=18, label="predicted")
    axes.set_xticks(number)
    axes.set_xlabel("measurement")
    axes.set_ylabel("rms difference [µm]")
    axes.legend()
    return axes


PLOTS: dict[str, Callable[[Any, Any], Any]] = {
    "budget": _budget,
    "compensate": _compensated,
    "evaluate": _sources,
    "identify": _identified,
    "merge": _study,
    "next": _plan,
    "plan": _plan,
    "study": _study,
    "validate": _validated,
}


def _refuse(record: Any) -> Axes:
    raise UsageError(f"{record.command} has no picture; those of {', '.join(sorted(PLOTS))} have one")


def plot(record: Any, axes: Axes | None) -> Axes:
    """A picture of what a record is about."""
    if record.command not in PLOTS:
        return _refuse(record)
    drawn: Axes = PLOTS[record.command](record, axes)
    return drawn
