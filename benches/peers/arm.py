"""The serial arm in NumPy, many configurations at a time (B configurations, n joints)."""

import numpy as np


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The vector product along the last axis; several times as fast as `numpy.cross`."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", a, b)


class Arm:
    """A chain of hinges with the tool at its end, from elastocal's `driver problem`."""

    def __init__(self, problem: dict, tool: str):
        joints = problem["joints"]
        frames = np.array([joint["previous_from_link"] for joint in joints])
        axes = np.array([joint["axis"] for joint in joints])
        assert problem[tool]["joints"] == len(joints), "all joints move the tool"
        skew = np.cross(np.eye(3), axes[:, None, :])
        self.fixed, self.offset, self.axes = frames[:, :3, :3], frames[:, :3, 3], axes
        # Rodrigues' formula: R = I + sin(q) S + (1 - cos(q)) S^2, after the fixed rotation.
        self.with_sine, self.with_cosine = self.fixed @ skew, self.fixed @ (skew @ skew)
        self.mass = np.array([joint["mass_kg"] for joint in joints])
        self.distal_mass = np.cumsum(self.mass[::-1])[::-1]
        self.centre = np.array([joint["centre_of_mass_m"] for joint in joints])
        self.tool = np.array(problem[tool]["link_from_tool"])[:3, 3]
        self.gravity = np.array(problem["gravity_m_s2"])

    def geometry(self, q: np.ndarray, masses: bool = False):
        """Axes z (B, n, 3), Jacobian columns of the tool (B, n, 3), its position (B, 3), and with
        `masses` the first moments that the joints move (B, n, 3)."""
        batch, joints = q.shape
        turn = self.fixed + np.sin(q)[..., None, None] * self.with_sine
        turn += (1 - np.cos(q))[..., None, None] * self.with_cosine
        rotation = np.empty((batch, joints, 3, 3))
        anchor = np.empty((batch, joints, 3))
        world, place = np.broadcast_to(np.eye(3), (batch, 3, 3)), np.zeros((batch, 3))
        for joint in range(joints):
            place = place + world @ self.offset[joint]
            world = world @ turn[:, joint]
            anchor[:, joint], rotation[:, joint] = place, world
        axis = np.einsum("bnij,nj->bni", rotation, self.axes)
        position = place + world @ self.tool
        columns = cross(axis, position[:, None] - anchor)
        if not masses:
            return axis, columns, position
        moments = self.mass[:, None] * (np.einsum("bnij,nj->bni", rotation, self.centre) + anchor)
        distal = np.cumsum(moments[:, ::-1], axis=1)[:, ::-1]
        return axis, columns, position, cross(axis, distal - self.distal_mass[:, None] * anchor)

    def rest(self, commanded: np.ndarray, force: np.ndarray, compliance: np.ndarray):
        """Static equilibria by Newton's method, with compliances (n) or of each (B, n): positions (B, 3), and their derivatives
        by the compliances (B, 3, n)."""
        q, last = commanded, False
        while True:
            axis, columns, position, moment = self.geometry(q, masses=True)
            torque = dot(columns, force[:, None]) + moment @ self.gravity
            # d tau_j / d q_i = z_a . (J_b x F + m_b x g) for a = min(i, j), b = max(i, j)
            pulled = cross(columns, force[:, None]) + cross(moment, self.gravity)
            upper = np.triu(axis @ pulled.transpose(0, 2, 1))
            gradient = upper + np.triu(upper, 1).transpose(0, 2, 1)
            system = np.eye(q.shape[1]) - compliance[..., None] * gradient
            if last:
                moved = np.linalg.solve(system, torque[:, :, None] * np.eye(q.shape[1]))
                return position, columns.transpose(0, 2, 1) @ moved
            step = np.linalg.solve(system, (commanded + compliance * torque - q)[..., None])[..., 0]
            q = q + step
            last = np.abs(step).max() <= 1e-12
