"""Monte Carlo runs: of the linear model in NumPy, and of the robot with MuJoCo's Python and NumPy."""

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
    """Measure three experiments, identify, compensate, and see what distance is left, 64 runs at a time: MuJoCo measures, NumPy
    identifies all runs together with the gain of the nominal robot, taken once."""

    def __init__(self, problem: dict):
        from arm import Arm
        from equilibrium_mujoco import Robot

        plan, pose = problem["plans"]["3"], problem["test_pose"]
        self.q, self.force = np.array(plan["q_rad"]), np.array(plan["wrench"])[:, :3]
        self.pose_q, self.pose_force = np.array(pose["q_rad"]), np.array(pose["wrench"][:3])
        self.measuring, self.machining = (Robot(problem, f"{tool}_tool") for tool in ["calibration", "machining"])
        self.modelled, self.arm = (Arm(problem, f"{tool}_tool") for tool in ["calibration", "machining"])
        self.nominal, self.parameters = np.array(problem["compliance_rad_per_nm"]), problem["parameters"]
        self.sigma = problem["sigma_m"]
        self.random = np.random.Generator(np.random.SFC64(1))
        _, moved = self.deflections(self.nominal[None])
        jacobian = (moved[0] * self.nominal)[..., self.parameters].reshape(-1, len(self.parameters)) / self.sigma
        self.information = jacobian.T @ jacobian
        self.gain = np.linalg.solve(self.information, jacobian.T)

    def deflections(self, compliance: np.ndarray):
        """What the model deflects with compliances (R, n), (R, m, 3), and the derivatives (R, m, 3, n)."""
        runs, count = len(compliance), len(self.q)
        q = np.tile(np.concatenate([self.q, self.q]), (runs, 1))
        force = np.tile(np.concatenate([0 * self.force, self.force]), (runs, 1))
        position, moved = self.modelled.rest(q, force, np.repeat(compliance, 2 * count, axis=0))
        position, moved = (each.reshape(runs, 2, count, *each.shape[1:]) for each in [position, moved])
        return position[:, 1] - position[:, 0], moved[:, 1] - moved[:, 0]

    def run(self, normals: np.ndarray):
        rest, none = self.measuring.rest, np.zeros(3)
        measured = [[rest(q, force) - rest(q, none) for q, force in zip(self.q, self.force)] for _ in normals]
        measured = np.array(measured) + self.sigma * normals.reshape(len(normals), -1, 3)
        compliance = np.tile(self.nominal, (len(normals), 1))
        step = 1.0
        while np.abs(step).max() > 1e-9:
            residual = measured - self.deflections(compliance)[0]
            step = residual.reshape(len(normals), -1) @ self.gain.T / self.sigma
            compliance[:, self.parameters] += step * self.nominal[self.parameters]
        # The truth is nominal.
        error = (compliance / self.nominal - 1)[:, self.parameters]
        nees = np.einsum("ri,ij,rj->r", error, self.information, error)
        commanded = self.pose_q - compliance * self.load_torque(compliance)
        rest = self.machining.rest
        # As elastocal does, the pose without compensation is looked at too.
        wanted = [(rest(self.pose_q, none), rest(self.pose_q, self.pose_force))[0] for _ in normals]
        residual = np.array([rest(q, self.pose_force) for q in commanded]) - wanted
        return np.einsum("ri,ri->r", residual, residual) / self.sigma**2, nees

    def load_torque(self, compliance: np.ndarray) -> np.ndarray:
        """The task load's torques at the unloaded equilibria, by fixed-point iteration."""
        q = np.broadcast_to(self.pose_q, compliance.shape)
        while True:
            _, columns, _, moment = self.arm.geometry(q, masses=True)
            sagging = self.pose_q + compliance * (moment @ self.arm.gravity)
            if np.abs(sagging - q).max() <= 1e-12:
                return columns @ self.pose_force
            q = sagging

    def blocks(self, count: int):
        return [self.run(self.random.standard_normal((64, 9))) for _ in range(count)]


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
    square, nees = robot.run(np.array(study["normals"])[:9].T)
    # The gain of the nominal robot weighs the measurements a little differently from that of each estimate.
    check("robot level", square, study["robot"]["square"], 1e-2)
    check("robot level", nees, study["robot"]["nees"], 1e-2)
    peer = "MuJoCo's Python, fixed gain"
    return [Row("Monte Carlo, robot level, m = 3", "study_robot", peer, robot.blocks)]
