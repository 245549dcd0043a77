"""The fit of 45 parameters to 1000 poses with SciPy's least_squares: the same residuals, in NumPy.

Elastocal's driver gives the arm, the readings, the parameters with their sizes, and what it found. SciPy gets the
residuals and takes differences for derivatives, as one would who writes such a fit; the parameters are in their
typical sizes. Both must come to the same values. With SciPy's own steps for the differences they do not: these are
so short (1.5e-8) that rounding leaves it a third of a standard error away, after four times the evaluations.
"""

import time

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from arm import cross, dot
from row import check
from timing import Result

AXES = "xyz"
STEP = 1e-6


class Poses:
    def __init__(self, problem: dict):
        fit = problem["fit"]
        joints = problem["joints"]
        frames = np.array([joint["previous_from_link"] for joint in joints])
        self.turn, self.offset = frames[:, :3, :3], frames[:, :3, 3]
        self.axes = np.array([joint["axis"] for joint in joints])
        self.names = [joint["name"] for joint in joints]
        tools = np.array([problem[name]["link_from_tool"] for name in ["calibration_tool", "machining_tool"]])
        self.tool_turn, self.tool_offset = tools[:, :3, :3], tools[:, :3, 3]
        self.mass = np.array([joint["mass_kg"] for joint in joints])
        self.centre = np.array([joint["centre_of_mass_m"] for joint in joints])
        self.gravity = np.array(problem["gravity_m_s2"])
        self.compliance = np.array(problem["compliance_rad_per_nm"])
        self.payload = fit["payload"]
        self.parameters = [each["name"] for each in fit["parameters"]]
        self.nominal = np.array([each["nominal"] for each in fit["parameters"]])
        self.scale = np.array([each["scale"] for each in fit["parameters"]])
        self.q, self.force = np.array(fit["q_rad"]), np.array(fit["force_n"])
        self.target = np.array(fit["target"])
        self.position = np.array(fit["position_m"])
        self.rotation = np.array(fit["rotation"]).reshape(-1, 3, 3)
        self.sigma = [fit["sigma_m"], fit["sigma_rad"]]

    def applied(self, relative: np.ndarray):
        """Displacements and rotation vectors of base, links and tools, compliances, and the payload."""
        moved: dict[str, np.ndarray] = {}
        compliance, mass = self.compliance.copy(), self.payload["mass_kg"]
        centre = np.array(self.payload["centre_of_mass_m"], dtype=float)
        for name, value in zip(self.parameters, self.nominal + self.scale * relative):
            owner, what = name.rsplit(".", 1)
            if what == "compliance":
                compliance[self.names.index(owner)] = value
            elif name == "payload.mass":
                mass *= np.exp(value)
            elif owner == "payload":
                centre[AXES.index(what)] = value
            else:
                moved.setdefault(owner, np.zeros(6))[AXES.index(what[-1]) + 3 * (len(what) - 1)] = value
        return moved, compliance, mass, centre

    def residuals(self, relative: np.ndarray) -> np.ndarray:
        moved, compliance, load_mass, load_centre = self.applied(relative)
        turn, offset = self.turn.copy(), self.offset.copy()
        tool_turn, tool_offset = self.tool_turn.copy(), self.tool_offset.copy()
        base_turn, base_offset = np.eye(3), np.zeros(3)
        for owner, values in moved.items():
            rotation = Rotation.from_rotvec(values[3:]).as_matrix()
            if owner.startswith("link_"):
                link = int(owner[5:]) - 1
                offset[link] = offset[link] + turn[link] @ values[:3]
                turn[link] = turn[link] @ rotation
            elif owner.startswith("tool"):
                tool = int(owner[5:] or 1) - 1
                tool_offset[tool] = tool_offset[tool] + tool_turn[tool] @ values[:3]
                tool_turn[tool] = tool_turn[tool] @ rotation
            else:
                base_turn, base_offset = rotation, values[:3]
        mass, centre = self.mass.copy(), self.centre.copy()
        link = self.payload["link"]
        mass[link] += load_mass
        centre[link] = (self.mass[link] * self.centre[link] + load_mass * load_centre) / mass[link]
        position, orientation = self.rest(turn, offset, tool_turn, tool_offset, mass, centre, compliance)
        position = position @ base_turn.T + base_offset
        apart = Rotation.from_matrix(self.rotation @ np.swapaxes(base_turn @ orientation, 1, 2)).as_rotvec()
        return np.concatenate(
            [(self.position - position).ravel() / self.sigma[0], apart.ravel() / self.sigma[1]]
        )

    def rest(self, turn, offset, tool_turn, tool_offset, mass, centre, compliance):
        """Static equilibria by Newton's method."""
        skew = np.cross(np.eye(3), self.axes[:, None, :])
        with_sine, with_cosine = turn @ skew, turn @ (skew @ skew)
        distal_mass = np.cumsum(mass[::-1])[::-1]
        q, count, joints = self.q, *self.q.shape
        while True:
            spin = turn + np.sin(q)[..., None, None] * with_sine
            spin += (1 - np.cos(q))[..., None, None] * with_cosine
            rotation, anchor = np.empty((count, joints, 3, 3)), np.empty((count, joints, 3))
            world, place = np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3))
            for joint in range(joints):
                place = place + world @ offset[joint]
                world = world @ spin[:, joint]
                anchor[:, joint], rotation[:, joint] = place, world
            axis = np.einsum("bnij,nj->bni", rotation, self.axes)
            position = place + np.einsum("bij,bj->bi", world, tool_offset[self.target])
            columns = cross(axis, position[:, None] - anchor)
            moments = mass[:, None] * (np.einsum("bnij,nj->bni", rotation, centre) + anchor)
            distal = np.cumsum(moments[:, ::-1], axis=1)[:, ::-1]
            moment = cross(axis, distal - distal_mass[:, None] * anchor)
            torque = dot(columns, self.force[:, None]) + moment @ self.gravity
            pulled = cross(columns, self.force[:, None]) + cross(moment, self.gravity)
            upper = np.triu(axis @ pulled.transpose(0, 2, 1))
            gradient = upper + np.triu(upper, 1).transpose(0, 2, 1)
            system = np.eye(joints) - compliance[:, None] * gradient
            step = np.linalg.solve(system, (self.q + compliance * torque - q)[..., None])[..., 0]
            if np.abs(step).max() <= 1e-12:
                return position, world @ tool_turn[self.target]
            q = q + step


def fit(name: str, driver, problem: dict, repetitions: int) -> Result:
    poses, expected = Poses(problem), problem["fit"]
    result = Result(name, "SciPy least_squares")
    driver.seconds("fit", 1)
    for _ in range(repetitions):
        result.ours_s.append(driver.seconds("fit", 1))
        start = time.perf_counter()
        found = least_squares(poses.residuals, np.zeros(len(poses.scale)), diff_step=STEP)
        result.peer_s.append(time.perf_counter() - start)
    check("sum of squares", 2 * found.cost, expected["square"], 1e-6)
    # In standard errors both are the same to a hundredth.
    errors = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    ours = (np.array(expected["values"]) - poses.nominal) / poses.scale
    assert np.abs((found.x - ours) / errors).max() < 0.01, "the peer's values are others"
    result.note = f"{expected['iterations']} steps, exact derivatives, one thread; {found.njev} steps with differences"
    return result
