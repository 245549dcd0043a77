"""What comes out: records with arrays, units in their names."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from . import _views
from ._data import Array, Plan

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


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

    @property
    def command(self) -> str:
        """The command that they are of."""
        return str(self.get("schema", {}).get("name", "elastocal")).removeprefix("elastocal.")

    def __repr__(self) -> str:
        about = [f"rho0 {1e3 * self['rho0_mm']:.4g} um"] if isinstance(self.get("rho0_mm"), float) else []
        key = _views.listed(self)
        about += [_views.counted(len(_views.rows(self, key)), _views.LISTS.get(self.command, (key, "row"))[1])] if key else []
        about += [str(each) for each in self.conditions]
        return f"<Results of {self.command}: {'; '.join(about) or f'{len(self)} keys'}>"

    def _repr_html_(self) -> str:
        return _views.html_text(self.text or repr(self)[1:-1], [str(each) for each in self.conditions])

    def to_dataframe(self, key: str | None = None) -> pd.DataFrame:
        """A table of the record: what the command is about, or the list of objects under ``key`` (``"a.b"``: b in a)."""
        return _views.frame_of_record(self, key)

    def plot(self, axes: Axes | None = None) -> Axes:
        """A picture of what the command is about, with Matplotlib."""
        return _views.plot(self, axes)


class Commanded(Protocol):
    """What has columns of configurations, as a scenario has."""

    @property
    def columns(self) -> list[str]:
        """``q1_deg``, or ``q1_mm`` for a slide."""


@dataclass(repr=False)
class Outcome:
    """``results`` is the whole record, ``scenario`` what it is of, where that is known."""

    results: Results
    scenario: Commanded | None = field(default=None, compare=False)

    @property
    def _columns(self) -> list[str] | None:
        return None if self.scenario is None else self.scenario.columns

    @property
    def conditions(self) -> list[Condition]:
        """What must be looked at."""
        return self.results.conditions

    @property
    def text(self) -> str:
        """What the command line prints for a person."""
        return self.results.text

    def _vector(self, key: str) -> Array:
        return np.array([np.nan if each is None else each for each in self.results.get(key, [])], dtype=float)

    def __repr__(self) -> str:
        return repr(self.results).replace("Results of", f"{type(self).__name__} by", 1)

    def _repr_html_(self) -> str:
        return self.results._repr_html_()

    def to_dataframe(self, key: str | None = None) -> pd.DataFrame:
        """A table of the record: what it is about, or the list of objects under ``key`` of ``results``."""
        return self.results.to_dataframe(key)

    def plot(self, axes: Axes | None = None) -> Axes:
        """A picture of it, with Matplotlib."""
        return self.results.plot(axes)


class Assessment(Outcome):
    """The predicted accuracy of a plan; ``results`` is the whole record."""

    def _metres(self, key: str) -> float | None:
        millimetres = self.results[key]
        return None if millimetres is None else float(millimetres) * 1e-3

    @property
    def rho0_m(self) -> float | None:
        """The rms distance that compensation leaves at the test poses (m); None where it is not determined."""
        return self._metres("rho0_mm")

    @property
    def lower_bound_rho0_m(self) -> float | None:
        """No plan of as many measurements is below (m); None where there is no bound."""
        return self._metres("lower_bound_rho0_mm")

    @property
    def efficiency(self) -> float | None:
        """The bound over rho0."""
        found: float | None = self.results["efficiency"]
        return found

    @property
    def compliance_std_rad_per_nm(self) -> Array:
        """The standard error that the plan predicts for each parameter (p,), rad/(N m); NaN where not determined.

        Empty where accuracy is absolute: ``results["unknowns"]`` tells all standard errors.
        """
        return self._vector("compliance_std_rad_per_nm")

    @property
    def violations(self) -> list[str]:
        """What is impossible about the plan."""
        return [str(each["text"]) for each in self.results.get("violations") or []]


class Design(Assessment):
    """A designed plan with what it predicts."""

    @property
    def plan(self) -> Plan:
        """The plan."""
        return Plan.from_record(self.results["plan"], self._columns)

    def __len__(self) -> int:
        return len(self.results["plan"])


class Identified(Outcome):
    """Identified compliances of p parameters; ``results`` is the whole record."""

    @property
    def names(self) -> list[str]:
        """The parameters' names (p,); of a fit to absolute readings those of all unknowns."""
        unknowns = self.results.get("unknowns")
        return list(self.results["parameters"]) if unknowns is None else [str(each["name"]) for each in unknowns]

    @property
    def compliance_rad_per_nm(self) -> Array:
        """Compliances (p,), rad/(N m); NaN where not determined. Empty of a fit to absolute readings: ``to_dataframe()`` has all."""
        return self._vector("compliance_rad_per_nm")

    @property
    def compliance_std_rad_per_nm(self) -> Array:
        """Standard errors (p,), rad/(N m); NaN where not determined. Empty of a fit to absolute readings."""
        return self._vector("compliance_std_rad_per_nm")

    @property
    def covariance(self) -> Array:
        """Covariance (p, p), (rad/(N m))^2, of absolute readings in the units of all unknowns; NaN where not determined."""
        rows = self.results["covariance" if "unknowns" in self.results else "covariance_rad2_per_n2m2"]
        return np.array([[np.nan if each is None else each for each in row] for row in rows], dtype=float)

    def __len__(self) -> int:
        return len(self.names)


class Compensation(Outcome):
    """Commanded angles at the test poses; ``results`` is the whole record."""

    @property
    def q_commanded_deg(self) -> Array:
        """One row a test pose (poses, n), deg; slides mm."""
        return np.array([pose["q_commanded_deg"] for pose in self.results["test_poses"]], dtype=float)

    @property
    def angles_rad(self) -> Array:
        """The same in radians; slides m."""
        slides = [name.endswith("_mm") for name in self._columns or []]
        q = self.q_commanded_deg
        return np.where(slides, q * 1e-3, np.radians(q)) if slides else np.radians(q)

    @property
    def residual_m(self) -> Array:
        """What compensation leaves on the virtual robot (poses,), m; not a number where another one was measured."""
        residuals = [pose["residual_mm"] for pose in self.results["test_poses"]]
        return np.array([np.nan if each is None else each * 1e-3 for each in residuals])

    def __len__(self) -> int:
        return len(self.results["test_poses"])


class Validation(Outcome):
    """Whether an identification errs as it predicts, or the plan for finding out; ``results`` is the whole record."""

    @property
    def plan(self) -> Plan:
        """What is to be measured for the validation; of a validation without measurements."""
        return Plan.from_record(self.results["plan"], self._columns)
