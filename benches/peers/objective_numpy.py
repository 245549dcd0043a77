"""rho0^2 of a plan (eq. 20) and its gradient by all joint angles, in NumPy."""

import numpy as np

from arm import Arm, cross, dot
from row import Row, check, repeat


class Objective:
    def __init__(self, problem: dict, wrench: np.ndarray):
        assert not wrench[:, 3:].any(), "forces only"
        self.force = wrench[:, None, :3]
        self.parameters = problem["parameters"]
        self.arm = Arm(problem, "calibration_tool")
        self.weights = problem["sigma_m"] ** 2 * weights(problem)

    def __call__(self, q: np.ndarray):
        axis, columns, _ = self.arm.geometry(q)
        parameters = self.parameters
        shown = columns[:, parameters]
        torque = dot(shown, self.force)
        matrix = shown * torque[..., None]  # A^T of each experiment, (m, p, 3)
        stacked = matrix.transpose(1, 0, 2).reshape(len(parameters), -1)
        inverse = np.linalg.inv(stacked @ stacked.T)
        directions = inverse @ self.weights
        value, directions = np.trace(directions), directions @ inverse
        # The derivative by the Jacobian's columns, and d J_a / d q_n = z_min x J_max.
        factor = np.einsum("ab,mbi->mai", -2 * directions, matrix)
        pull = np.zeros_like(columns)
        pull[:, parameters] = factor * torque[..., None] + self.force * dot(factor, shown)[..., None]
        outer = np.cumsum(cross(columns, pull)[:, ::-1], axis=1)[:, ::-1]
        inner = cross(pull, axis)
        inner = np.cumsum(inner, axis=1) - inner
        return value, dot(axis, outer) + dot(columns, inner)


def weights(problem: dict) -> np.ndarray:
    """A_0^T A_0 at the test pose (eq. 23)."""
    matrix = test_pose_matrix(problem)
    return matrix.T @ matrix


def test_pose_matrix(problem: dict) -> np.ndarray:
    pose = problem["test_pose"]
    _, columns, _ = Arm(problem, "machining_tool").geometry(np.array([pose["q_rad"]]))
    shown = columns[0, problem["parameters"]]
    return (shown * (shown @ np.array(pose["wrench"][:3]))[:, None]).T


def rows(problem: dict) -> list[Row]:
    result = []
    for size, plan in sorted(problem["plans"].items(), key=lambda item: int(item[0])):
        q = np.array(plan["q_rad"])
        objective = Objective(problem, np.array(plan["wrench"]))
        value, gradient = objective(q)
        check("objective", value, plan["rho0_square_m2"], 1e-9)
        check("gradient", gradient.ravel(), plan["gradient"], 1e-9)
        work = repeat(lambda objective=objective, q=q: objective(q))
        result.append(Row(f"objective and gradient, m = {size}", f"objective_{size}", "NumPy", work))
    return result
