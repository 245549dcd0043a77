"""A plan found by SciPy, with the objective and its gradient from elastocal.

    python examples/own_optimiser.py scenarios/klimchik2012.toml
"""

import sys

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

import elastocal as ec

Array = NDArray[np.float64]


def main(path: str) -> None:
    scenario = ec.Scenario.load(path)
    problem = scenario.problem
    low, high = problem.ranges_deg
    joints, experiments = len(low), 3
    weight = np.array([0.0, 0.0, -2500.0, 0.0, 0.0, 0.0])
    random = np.random.default_rng(1)

    def plan_of(q_deg: Array) -> ec.Plan:
        return ec.Plan(q_deg.reshape(experiments, joints), weight, unit="deg")

    def logarithm(q_deg: Array) -> tuple[float, Array]:
        value, gradient = problem.objective(plan_of(q_deg))
        return float(np.log(value)), np.radians(gradient).ravel() / value

    def possible() -> Array:
        """Configurations at random in which the scenario lets a robot be."""
        rows: list[Array] = []
        while len(rows) < experiments:
            row = random.uniform(low, high)
            if not problem.violations(row, weight):
                rows.append(row)
        return np.concatenate(rows)

    def search() -> Array:
        """From a possible plan to the optimum, which knows joint ranges alone, and back as far as the plan is impossible."""
        start = possible()
        end = minimize(logarithm, start, jac=True, bounds=list(zip(low, high)) * experiments).x
        ways = [start + share * (end - start) for share in np.linspace(1, 0, 41)]
        return min((each for each in ways if not problem.violations(plan_of(each))), key=lambda each: logarithm(each)[0])

    best = plan_of(min((search() for _ in range(8)), key=lambda each: logarithm(each)[0]))
    assessed = scenario.evaluate(best, no_proof=True)
    design = scenario.design(experiments=experiments, no_proof=True)
    for name, found in {"SciPy": assessed, "elastocal": design}.items():
        assert found.rho0_m is not None and not found.violations
        print(f"{name}: rho0 = {1e6 * found.rho0_m:.3f} um, a possible plan")
    if design.lower_bound_rho0_m is not None:
        print(f"no plan is below {1e6 * design.lower_bound_rho0_m:.3f} um")


if __name__ == "__main__":
    main(*sys.argv[1:] or ["scenarios/klimchik2012.toml"])
