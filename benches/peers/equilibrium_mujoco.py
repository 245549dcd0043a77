"""A virtual measurement with MuJoCo's Python: stepping until rest, and by fixed-point iteration on its statics."""

import mujoco
import numpy as np

from row import Row, check, repeat

REST_RAD_S = 1e-11


class Robot:
    """The compliant robot with a tool, without contacts and joint limits; it may have passive joints, too."""

    def __init__(self, problem: dict, tool: str, model: str | None = None):
        self.compliance = np.array(problem["compliance_rad_per_nm"])
        self.model = mujoco.MjModel.from_xml_path(model or problem["model"])
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.model.actuator_gainprm[:, 0] = 1 / self.compliance
        self.model.actuator_biasprm[:, 1] = -1 / self.compliance
        self.data = mujoco.MjData(self.model)
        self.actuated = self.model.jnt_qposadr[self.model.actuator_trnid[:, 0]]
        self.site = self.model.site(problem[tool]["site"]).id
        self.body = self.model.site_bodyid[self.site]
        self.jacobian = np.zeros((3, self.model.nv))
        self.bias = np.zeros(self.model.nv)

    def settle(self, commanded: np.ndarray, force: np.ndarray) -> np.ndarray:
        """The tool's position (m) when the simulation has come to rest."""
        model, data, torque = self.model, self.data, np.zeros(3)
        mujoco.mj_resetData(model, data)
        data.qpos[self.actuated] = data.ctrl[:] = commanded
        point, applied, speeds = data.site_xpos[self.site], data.qfrc_applied, data.qvel
        steps = 0
        while steps <= 10 or np.abs(speeds).max() >= REST_RAD_S:
            mujoco.mj_step1(model, data)
            applied[:] = 0
            mujoco.mj_applyFT(model, data, force, torque, point, self.body, applied)
            mujoco.mj_step2(model, data)
            steps += 1
        mujoco.mj_kinematics(model, data)
        return point.copy()

    def rest(self, commanded: np.ndarray, force: np.ndarray) -> np.ndarray:
        """The same without time: q = commanded + k tau(q), iterated."""
        model, data = self.model, self.data
        data.qvel[:] = 0
        data.qpos[:] = commanded
        while True:
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_comVel(model, data)
            mujoco.mj_rne(model, data, 0, self.bias)
            mujoco.mj_jacSite(model, data, self.jacobian, None, self.site)
            q = commanded + self.compliance * (force @ self.jacobian - self.bias)
            step = np.abs(q - data.qpos).max()
            data.qpos[:] = q
            if step <= 1e-12:
                return data.site_xpos[self.site].copy()


def rows(problem: dict) -> list[Row]:
    robot = Robot(problem, "calibration_tool")
    plan = problem["plans"]["3"]
    q, force = np.array(plan["q_rad"][0]), np.array(plan["wrench"][0][:3])
    loads = [np.zeros(3), force]
    result = []
    for peer, find in [("stepping until rest", robot.settle), ("fixed point", robot.rest)]:
        for load, expected in zip(loads, problem["equilibrium"]["tool_m"]):
            check(peer, find(q, load), expected, 1e-9)
        both = repeat(lambda find=find: [find(q, load) for load in loads])
        loaded = repeat(lambda find=find: find(q, force))
        peer = f"MuJoCo's Python, {peer}"
        result.append(Row("static equilibrium", "equilibrium", peer, loaded))
        result.append(Row("virtual measurement", "measurement", peer, both))
    flexible = Robot(problem, "calibration_tool", problem["flexible"]["model"])
    for load, expected in zip(loads, problem["flexible"]["tool_m"]):
        check("stepping until rest", flexible.settle(q, load), expected, 1e-9)
    both = repeat(lambda: [flexible.settle(q, load) for load in loads])
    name = "virtual measurement, compensator and 3 passive joints"
    result.append(Row(name, "measurement_flexible", "MuJoCo's Python, stepping until rest", both))
    return result
