#!/usr/bin/env python3
"""Absolute readings of a UR10 that is not as its model says, by MuJoCo's own Python package: tests/golden/ur10_*.csv.gz.

Usage: tests/golden/simulate_ur10.py [FOLDER]    (pip install mujoco==3.17.0 numpy)

Nothing of elastocal is used: the robot's rest is that of q = q_commanded + zero + k tau(q), by MuJoCo's gravity and Jacobians,
with every link's place, joint zero and compliance off by a little. The tables are made once and kept; `tools/pins` reads them.
Made again, they differ only where MuJoCo or NumPy do.
"""

import gzip
import sys
from pathlib import Path

import mujoco
import numpy as np

HERE = Path(__file__).resolve().parent
COMPLIANCE_RAD_PER_NM = np.array([1.5e-5, 2e-5, 3e-5, 8e-5, 9e-5, 1.2e-4])
#: Of wrist_3_link, in metres: where the reflectors are. The load hangs where the model has the first.
TARGETS = {"reflector": [0.12, 0.05, 0.19], "spindle": [0.0, 0.0, 0.25], "third": [-0.09, 0.11, 0.16]}
LOAD_AT_M = np.array(TARGETS["reflector"])
NOISE_MM, NOISE_MRAD = 0.03, 0.05
REPEATABILITY_RAD = 3e-5


def rotation(vector):
    """The rotation matrix of a rotation vector."""
    quat, matrix = np.empty(4), np.empty(9)
    angle = np.linalg.norm(vector)
    mujoco.mju_axisAngle2Quat(quat, vector / angle if angle else np.array([0.0, 0.0, 1.0]), angle)
    mujoco.mju_quat2Mat(matrix, quat)
    return matrix.reshape(3, 3)


def quaternion(matrix):
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, matrix.ravel())
    return quat if quat[0] >= 0 else -quat


class Robot:
    """One that was made a little differently."""

    def __init__(self, random):
        self.model = mujoco.MjModel.from_xml_path(str(HERE.parents[1] / "models/ur10.xml"))
        self.data = mujoco.MjData(self.model)
        for body in range(1, self.model.nbody):
            self.model.body_pos[body] += random.normal(0, 5e-4, 3)
            quat, turn = np.empty(4), np.empty(4)
            error = random.normal(0, 5e-4, 3)
            mujoco.mju_axisAngle2Quat(turn, error / np.linalg.norm(error), np.linalg.norm(error))
            mujoco.mju_mulQuat(quat, self.model.body_quat[body], turn)
            self.model.body_quat[body] = quat
        self.zero = random.normal(0, 1e-3, 6)
        self.compliance = COMPLIANCE_RAD_PER_NM * np.exp(random.normal(0, 0.2, 6))
        self.targets = {name: np.array(at) + random.normal(0, 2e-3, 3) for name, at in TARGETS.items()}
        self.mounted = rotation(random.normal(0, 0.01, 3))
        self.waves = [(0.0, 0.0, 1)] * 6

    def off(self, q):
        """Transmission errors (rad), each a function of its joint's angle."""
        return np.array([sum(a * np.sin(n * angle + phase) for a, phase, n in np.reshape(wave, (-1, 3)))
                         for wave, angle in zip(self.waves, q)])

    def rest(self, commanded, force, error):
        """Position and rotation of the last link at rest, with joints off by `error`."""
        start = commanded + self.zero + error + self.off(commanded)
        q, last = start.copy(), self.model.nbody - 1
        for _ in range(60):
            self.data.qpos[:], self.data.qvel[:] = q, 0
            mujoco.mj_forward(self.model, self.data)
            turned = self.data.xmat[last].reshape(3, 3)
            jacobian = np.zeros((3, 6))
            mujoco.mj_jac(self.model, self.data, jacobian, None, self.data.xpos[last] + turned @ LOAD_AT_M, last)
            following = start + self.compliance * (jacobian.T @ force - self.data.qfrc_bias)
            if np.max(np.abs(following - q)) < 1e-14:
                break
            q = following
        return self.data.xpos[last].copy(), turned.copy()


def poses(random, count):
    """Commanded configurations (rad), as the table writes them."""
    low, high = np.radians([[-170, -140, 20, -170, -170, -170], [170, -35, 120, 170, 170, 170]])
    return np.radians(np.round(np.degrees(random.uniform(low, high, (count, 6))), 3))


def station(random):
    """world_from_instrument, as position and rotation."""
    return random.uniform([-4, -4, 0.5], [-2, 4, 1.5]), rotation(random.normal(0, 1.0, 3))


def table(random, robot, commanded, targets, stations, loaded=False, is_pose=False):
    """Rows as text: each pose is one visit, with one draw of its joints' repeatability."""
    head = [f"q{j}_deg" for j in range(1, 7)] + ["fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm", "target", "station", "visit"]
    head += ["x_mm", "y_mm", "z_mm"] + (["qw", "qx", "qy", "qz"] if is_pose else []) + ["sx_mm", "sy_mm", "sz_mm"]
    head += ["srx_mrad", "sry_mrad", "srz_mrad"] if is_pose else []
    rows = []
    for visit, q in enumerate(commanded):
        force = np.array([0, 0, -98.0 if loaded and visit % 2 else 0])
        at, turned = robot.rest(q, force, random.normal(0, REPEATABILITY_RAD, 6))
        for name in targets:
            for stands, (origin, axes) in stations.items():
                seen = axes.T @ (at + turned @ robot.targets[name] - origin) * 1e3 + random.normal(0, NOISE_MM, 3)
                row = [f"{x:.3f}" for x in np.degrees(q)] + [f"{x:g}" for x in [*force, 0, 0, 0]]
                row += [name, stands, f"v{visit}"] + [f"{x:.4f}" for x in seen]
                if is_pose:
                    noise = rotation(random.normal(0, NOISE_MRAD * 1e-3, 3))
                    row += [f"{x:.8f}" for x in quaternion(noise @ axes.T @ turned @ robot.mounted)]
                row += [f"{NOISE_MM}"] * 3 + ([f"{NOISE_MRAD}"] * 3 if is_pose else [])
                rows.append(row)
    return [head, *rows]


def spoilt(random, rows, lost):
    """5 % gross errors, copies of what the instrument had shown before, and as many readings of nothing."""
    first = rows[0].index("x_mm")
    places = random.permutation(np.arange(1, len(rows)))
    for place in places[:6]:
        error = random.normal(0, 1, 3)
        error *= random.uniform(5, 50) / np.linalg.norm(error)
        rows[place][first:first + 3] = [f"{float(x) + e:.4f}" for x, e in zip(rows[place][first:first + 3], error)]
    for place in places[6:10]:
        rows[place][first:first + 3] = rows[place - 1][first:first + 3]
    for place in places[10:10 + lost]:
        rows[place][first:first + 3] = ["0", "0", "0"]
    return rows


def main():
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE
    random = np.random.default_rng(20120731)
    robot = Robot(random)
    places = {name: station(random) for name in ("door", "wall")}
    one = {"door": places["door"]}
    made = {"visits": table(random, robot, poses(random, 300), TARGETS, places, loaded=True)}
    for name, lost in (("gross", 0), ("lost", 3)):
        made[name] = spoilt(random, table(random, robot, poses(random, 120), ["reflector"], one), lost)
    robot.waves = [[(4e-4 / n, random.uniform(0, 6), n) for n in (1, 2, 5)] for _ in range(6)]
    made["gears"] = table(random, robot, poses(random, 120), ["reflector"], one, is_pose=True)
    robot.waves = [(0.0, 0.0, 1)] * 6
    robot.zero[2] += 5e-4
    moved = {name: station(random) for name in places}
    made["later"] = table(random, robot, poses(random, 60), TARGETS, moved, loaded=True)
    for name, rows in made.items():
        text = "".join(",".join(row) + "\n" for row in rows)
        (folder / f"ur10_{name}.csv.gz").write_bytes(gzip.compress(text.encode(), mtime=0))
        print(f"ur10_{name}.csv.gz: {len(rows) - 1} readings")


if __name__ == "__main__":
    main()
