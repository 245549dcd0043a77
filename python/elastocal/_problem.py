"""The planning problem in numbers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from os import fspath
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from . import _change
from ._data import Array, FilePath, Plan, numbers
from ._elastocal import PlanningProblem
from ._errors import ElastocalError, UsageError


@contextmanager
def _told() -> Iterator[None]:
    """What does not fit the robot, as this package's error."""
    try:
        yield
    except UsageError:
        raise
    except ValueError as error:
        raise UsageError(str(error)) from None


class Problem:
    """The planning problem in numbers, for one's own criterion or optimiser."""

    def __init__(self, path: FilePath, noise_only: bool = False) -> None:
        self.path = Path(fspath(path))
        self._noise_only = noise_only
        try:
            self._problem = PlanningProblem(str(self.path), noise_only)
        except ValueError as error:
            raise ElastocalError(str(error)) from None

    def __reduce__(self) -> tuple[type[Problem], tuple[Path, bool]]:
        return Problem, (self.path, self._noise_only)

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
        with _told():
            [q], [load] = (numbers(name, np.reshape(each, (1, -1))).tolist() for name, each in (("q_deg", q_deg), ("wrench", wrench)))
            return np.array(self._problem.observation_matrix(q, load))

    def test_pose_matrices(self) -> list[Array]:
        """Eq. 23 for each test pose, times the root of its weight: (3, p) each, m N m/rad."""
        return [np.array(each) for each in self._problem.test_pose_matrices()]

    def information(self, plan: Plan) -> Array:
        """The information of a plan by noise alone, eq. 12: (p, p), ((N m)/rad)^2."""
        plan._named(self.columns)
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
        if not isinstance(plan, Plan):
            raise UsageError(f"plan is a Plan, not a {type(plan).__name__}", "ec.Plan(q_deg, wrench) makes one of arrays")
        with _told():
            value, gradient = self._problem.objective(*self._rows(plan))
        return value, np.array(gradient)

    def violations(self, plan: Plan | ArrayLike, wrench: ArrayLike | None = None) -> list[str]:
        """What is impossible about a plan, or about configurations (m, n) in deg, in words: ranges, collisions, sight, loads.

        Configurations are taken with ``wrench`` (6,), or with the scenario's load where that is fixed.
        """
        if not isinstance(plan, Plan):
            plan = Plan(plan, self._load() if wrench is None else wrench, unit="deg")
        with _told():
            return self._problem.violations(*self._rows(plan))

    def _rows(self, plan: Plan) -> tuple[list[list[float]], list[list[float]], list[int]]:
        plan._named(self.columns)
        return plan.q_deg.tolist(), plan.wrench.tolist(), plan.repeats.tolist()

    def _load(self) -> list[float]:
        load = _change.table(self.path)["load"]
        if load["kind"] != "fixed":
            raise UsageError("the scenario has no fixed load: violations(q, wrench) takes one", "wrench: fx, fy, fz (N), tx, ty, tz (N m)")
        return [*load["force_n"], *load.get("torque_nm", [0.0, 0.0, 0.0])]
