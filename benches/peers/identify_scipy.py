"""Identification with its covariance: linear with NumPy's lstsq, non-linear with SciPy's least_squares."""

import numpy as np
from scipy.optimize import least_squares

from arm import Arm, dot
from row import Row, check, repeat


class Identification:
    def __init__(self, problem: dict):
        self.arm = Arm(problem, "calibration_tool")
        self.nominal = np.array(problem["compliance_rad_per_nm"])
        self.parameters = problem["parameters"]
        self.typical = self.nominal[self.parameters]
        self.sigma = problem["sigma_m"]

    def linear(self, q: np.ndarray, force: np.ndarray, deflection: np.ndarray):
        """Compliances in units of the nominal ones, and their covariance."""
        _, columns, _ = self.arm.geometry(q)
        matrix = columns * dot(columns, force[:, None])[..., None] * self.nominal[:, None]
        matrix = matrix.transpose(0, 2, 1).reshape(-1, len(self.nominal)) / self.sigma
        known = np.ones(len(self.nominal))
        known[self.parameters] = 0
        right = deflection.ravel() / self.sigma - matrix @ known
        matrix = matrix[:, self.parameters]
        found = np.linalg.lstsq(matrix, right)[0]
        return found, np.linalg.inv(matrix.T @ matrix)

    def nonlinear(self, q: np.ndarray, force: np.ndarray, deflection: np.ndarray):
        """The same through the static equilibria, from the linear estimate, with exact derivatives."""
        count = len(q)
        both, forces = np.concatenate([q, q]), np.concatenate([0 * force, force])
        latest: dict[bytes, tuple] = {}

        def modelled(relative: np.ndarray):
            key = relative.tobytes()
            if key not in latest:
                compliance = self.nominal.copy()
                compliance[self.parameters] = relative * self.typical
                position, moved = self.arm.rest(both, forces, compliance)
                residual = (position[count:] - position[:count] - deflection).ravel() / self.sigma
                moved = (moved[count:] - moved[:count])[..., self.parameters]
                latest.clear()
                jacobian = moved.reshape(-1, len(self.typical)) * self.typical / self.sigma
                latest[key] = residual, jacobian
            return latest[key]

        fit = least_squares(
            lambda x: modelled(x)[0],
            self.linear(q, force, deflection)[0],
            jac=lambda x: modelled(x)[1],
            method="lm",
            xtol=1e-9,
        )
        jacobian = modelled(fit.x)[1]
        return fit.x, np.linalg.inv(jacobian.T @ jacobian)


def rows(problem: dict) -> list[Row]:
    identification = Identification(problem)
    typical = identification.typical
    result = []
    for method, peer in [("linear", "NumPy lstsq"), ("nonlinear", "SciPy least_squares")]:
        for size, plan in sorted(problem["plans"].items(), key=lambda item: int(item[0])):
            q, deflection = np.array(plan["q_rad"]), np.array(plan["deflection_m"])
            force = np.array(plan["wrench"])[:, :3]
            identify = getattr(identification, method)
            found, covariance = identify(q, force, deflection)
            expected = plan[method]
            compliance = np.array(expected["compliance_rad_per_nm"])[identification.parameters]
            check(method, found, compliance / typical, 1e-8)
            check(method, covariance * np.outer(typical, typical), expected["covariance"], 1e-6)
            work = repeat(lambda f=identify, a=(q, force, deflection): f(*a))
            name = f"identification, {method}, m = {size}"
            result.append(Row(name, f"identify_{method}_{size}", peer, work))
    return result
