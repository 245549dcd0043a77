"""Geometry and frames of a robot from absolute poses, by FIGAROH's own calibration workflow.

FIGAROH reads a URDF and a table, finds the frames in closed form, leaves out what it cannot tell apart (QR decomposition of
the regressor, then columns that the frames absorb), and fits by SciPy's least_squares with differences. It is told the
weights. Joint elasticity is not asked of it: with an unknown base, `full_params` overwrites the first six parameters by the
base's, which are the joints' elastic ones.
"""

import logging
import time
import warnings
from pathlib import Path

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

TOOL = "flange"


def urdf(robot: dict, file: Path) -> None:
    """The nominal robot; every joint turns about its z axis."""
    links = ['<link name="base"/>']
    for number, joint in enumerate(robot["joints"]):
        assert np.allclose(joint["axis"], [0, 0, 1])
        frame = joint["previous_from_link"]
        turned = " ".join(map(repr, map(float, Rotation.from_matrix(frame[:3, :3]).as_euler("xyz"))))
        moved = " ".join(map(repr, map(float, frame[:3, 3])))
        parent = robot["joints"][number - 1]["name"] + "_link" if number else "base"
        own = joint["name"] + "_link"
        links.append(
            f'<link name="{own}"/><joint name="{joint["name"]}" type="revolute"><parent link="{parent}"/><child link="{own}"/>'
            f'<origin xyz="{moved}" rpy="{turned}"/><axis xyz="0 0 1"/>'
            '<limit lower="-6.2832" upper="6.2832" effort="1" velocity="1"/></joint>'
        )
    last = robot["joints"][-1]["name"] + "_link"
    links.append(
        f'<link name="{TOOL}"/><joint name="to_{TOOL}" type="fixed"><parent link="{last}"/><child link="{TOOL}"/></joint>'
    )
    file.write_text(f'<robot name="ur10">{"".join(links)}</robot>')


def table(robot: dict, q_rad, position_m, rotation, file: Path) -> None:
    angles = Rotation.from_matrix(rotation).as_euler("xyz")
    names = ["x1", "y1", "z1", "phix1", "phiy1", "phiz1"] + [joint["name"] for joint in robot["joints"]]
    np.savetxt(file, np.hstack([position_m, angles, q_rad]), "%.17g", ",", header=",".join(names), comments="")


def settings(robot: dict, rows: int, source: Path, file: Path) -> None:
    calibration = {
        "type": "kinematic_calibration",
        "kinematics": {"base_frame": "universe", "tool_frame": TOOL},
        "parameters": {"calibration_level": "full_params", "outlier_threshold": None},
        "measurements": {"markers": [{"ref_joint": robot["joints"][-1]["name"], "measurable_dof": [True] * 6}]},
        "data": {"number_of_samples": rows, "source_file": str(source)},
    }
    file.write_text(yaml.safe_dump({"robot": {"name": "ur10"}, "tasks": {"calibration": calibration}}))


def fitted(robot: dict, q_rad, position_m, rotation, sigma: list[float], folder: Path) -> tuple[int, float, float]:
    """The number of parameters, the mean distance that is left (m), and the time (s) from the files to the fit."""
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    from figaroh.calibration.base_calibration import BaseCalibration
    from figaroh.calibration.calibration_tools import calc_updated_fkm
    from figaroh.tools.load_robot import load_robot

    class Calibration(BaseCalibration):
        def __init__(self, robot, config_file):
            super().__init__(robot, config_file)
            self.calib_config["known_baseframe"] = False
            self.calib_config["known_tipframe"] = False

        def cost_function(self, var):
            estimated = calc_updated_fkm(self.model, self.data, var, self.q_measured, self.calib_config)
            residuals = self._compute_logmap_residuals(self.PEE_measured, estimated)
            return self.apply_measurement_weighting(residuals, 1 / sigma[0], 1 / sigma[1])

    model, rows, config = folder / "ur10.urdf", folder / "rows.csv", folder / "figaroh.yaml"
    urdf(robot, model)
    table(robot, q_rad, position_m, rotation, rows)
    settings(robot, len(q_rad), rows, config)
    start = time.perf_counter()
    calibration = Calibration(load_robot(str(model), package_dirs=str(folder)), str(config))
    calibration.initialize()
    found, _ = calibration.solve_optimisation()
    elapsed = time.perf_counter() - start
    assert found.success, found.message
    residuals = calibration._compute_logmap_residuals(
        calibration.PEE_measured, calibration.get_pose_from_measure(found.x)
    )
    distance = np.linalg.norm(residuals.reshape(6, -1)[:3], axis=0).mean()
    return len(found.x), float(distance), elapsed
