"""Monte Carlo runs: of the linear model in NumPy, and of the robot with MuJoCo's Python and SciPy."""

import numpy as np

from objective_numpy import Objective, test_pose_matrix
from row import Row, check

# Runs to a batch: their normals stay in the second-level cache.
BATCH = 2048


class ModelRuns:
    """A run's squared distance and normalised estimation error, both in sigma^2, from 36 normals."""

    def __init__(self, problem: dict):
        plan = problem["plans"]["12"]
        objective = Objective(problem, np.array(plan["wrench"]))
        _, columns, _ = objective.arm.geometry(np.array(plan["q_rad"]))
        shown = columns[:, problem["parameters"]]
        matrix = shown * np.einsum("mai,mai->ma", shown, np.broadcast_to(objective.force, shown.shape))[..., None]
        matrix = matrix.transpose(1, 0, 2).reshape(len(problem["parameters"]), -1)
        factor = np.linalg.cholesky(matrix @ matrix.T)
        self.whitener = np.ascontiguousarray(np.linalg.solve(factor, matrix).T)
        self.compensation = np.ascontiguousarray(np.linalg.solve(factor, test_pose_matrix(problem).T))
        self.random = np.random.Generator(np.random.SFC64(1))
        self.normals = np.empty((BATCH, matrix.shape[1]))

    def run(self, normals: np.ndarray):
        whitened = normals @ self.whitener
        errors = whitened @ self.compensation
        square = np.einsum("ri,ri->r", errors, errors)
        return square, np.einsum("ri,ri->r", whitened, whitened)

    def blocks(self, count: int):
        """Sums over so many batches; without the histogram that elastocal also keeps."""
        sums = np.zeros(3)
        for _ in range(count):
            self.random.standard_normal(out=self.normals)
            square, nees = self.run(self.normals)
            sums += np.sqrt(square).sum(), square.sum(), nees.sum()
        return sums


class RobotRuns:
    """Measure three experiments, identify, compensate, and see what distance is left, 64 times."""

    def __init__(self, problem: dict):
        from arm import Arm
        from equilibrium_mujoco import Robot
        from identify_scipy import Identification

        plan, pose = problem["plans"]["3"], problem["test_pose"]
        self.q, self.force = np.array(plan["q_rad"]), np.array(plan["wrench"])[:, :3]
        self.pose_q, self.pose_force = np.array(pose["q_rad"]), np.array(pose["wrench"][:3])
        self.measuring, self.machining = (Robot(problem, f"{tool}_tool") for tool in ["calibration", "machining"])
        self.arm = Arm(problem, "machining_tool")
        self.identification = Identification(problem)
        self.sigma = problem["sigma_m"]
        self.random = np.random.Generator(np.random.SFC64(1))

    def run(self, normals: np.ndarray):
        rest, none = self.measuring.rest, np.zeros(3)
        measured = [rest(q, force) - rest(q, none) for q, force in zip(self.q, self.force)]
        measured = np.array(measured) + self.sigma * normals.reshape(-1, 3)
        relative, covariance = self.identification.nonlinear(self.q, self.force, measured)
        compliance = self.identification.nominal.copy()
        compliance[self.identification.parameters] *= relative
        # The truth is nominal: 1 in relative units.
        nees = (relative - 1) @ np.linalg.solve(covariance, relative - 1)
        commanded = self.pose_q - compliance * self.load_torque(compliance)
        rest = self.machining.rest
        # As elastocal does, the pose without compensation is looked at too.
        wanted, _ = rest(self.pose_q, none), rest(self.pose_q, self.pose_force)
        residual = rest(commanded, self.pose_force) - wanted
        return residual @ residual / self.sigma**2, nees

    def load_torque(self, compliance: np.ndarray) -> np.ndarray:
        """The task load's torques at the unloaded equilibrium, by fixed-point iteration."""
        q = self.pose_q
        while True:
            _, columns, _, moment = self.arm.geometry(q[None], masses=True)
            sagging = self.pose_q + compliance * (moment[0] @ self.arm.gravity)
            if np.abs(sagging - q).max() <= 1e-12:
                return columns[0] @ self.pose_force
            q = sagging

    def blocks(self, count: int):
        return [self.run(self.random.standard_normal(9)) for _ in range(64 * count)]


def rows(problem: dict) -> list[Row]:
    study = problem["study"]
    normals = np.array(study["normals"]).T
    model = ModelRuns(problem)
    square, nees = model.run(normals)
    check("model level", square, study["model"]["square"], 1e-9)
    check("model level", nees, study["model"]["nees"], 1e-9)
    return [Row("Monte Carlo, model level, m = 12", "study_model", "NumPy", model.blocks)]


def robot_rows(problem: dict) -> list[Row]:
    study = problem["study"]
    robot = RobotRuns(problem)
    found = np.array([robot.run(run[:9]) for run in np.array(study["normals"]).T])
    check("robot level", found[:, 0], study["robot"]["square"], 1e-5)
    check("robot level", found[:, 1], study["robot"]["nees"], 1e-5)
    peer = "MuJoCo's Python, SciPy"
    return [Row("Monte Carlo, robot level, m = 3", "study_robot", peer, robot.blocks)]
