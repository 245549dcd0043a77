"""A plan found by SciPy, with the objective and its gradient from elastocal.

    python examples/own_optimiser.py scenarios/klimchik2012.toml
"""

import sys

import numpy as np
from scipy.optimize import minimize

import elastocal as ec


def main(path: str) -> None:
    scenario = ec.Scenario.load(path)
    problem = scenario.problem
    low, high = problem.ranges_deg
    joints, experiments = len(low), 3
    weight = np.array([0.0, 0.0, -2500.0, 0.0, 0.0, 0.0])
    random = np.random.default_rng(1)

    def plan_of(q_deg: np.ndarray) -> ec.Plan:
        return ec.Plan.of(q_deg.reshape(experiments, joints), weight)

    def logarithm(q_deg: np.ndarray) -> tuple[float, np.ndarray]:
        value, gradient = problem.objective(plan_of(q_deg))
        return np.log(value), np.radians(gradient).ravel() / value

    found = [
        minimize(
            logarithm,
            random.uniform(low, high, (experiments, joints)).ravel(),
            jac=True,
            bounds=list(zip(low, high)) * experiments,
        )
        for _ in range(8)
    ]
    best = plan_of(min(found, key=lambda each: each.fun).x)
    # SciPy knows joint ranges alone; elastocal names what else the scenario asks for.
    assessed = scenario.evaluate(best, no_proof=True)
    found = "; ".join(map(str, assessed.conditions)) or "a possible plan"
    print(f"SciPy: rho0 = {1e6 * assessed.rho0_m:.3f} um, {found}")
    design = scenario.design(experiments=experiments, no_proof=True)
    print(f"elastocal: rho0 = {1e6 * design.rho0_m:.3f} um, no plan below {1e6 * design.lower_bound_rho0_m:.3f} um")


if __name__ == "__main__":
    main(*sys.argv[1:] or ["scenarios/klimchik2012.toml"])
