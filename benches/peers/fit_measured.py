"""A robot from 2773 absolute poses: `elastocal identify` beside SciPy's least_squares and FIGAROH on the same rows.

The rows are a UR10's that a laser tracker saw (series C of christianlandgraf/ipa-robot-accuracy), where they are: in the
folder that ELASTOCAL_UR10_IPA names, or in data/ur10_ipa of a folder beside the project. Elsewhere as many rows are made up
of a UR10 with errors of geometry and noise. elastocal's time is that of the whole process: it reads the file, finds the
frames by itself, leaves out what is redundant, weighs by what the model leaves, and writes. SciPy is told all that: frames
to begin with, parameters with their sizes, weights; it takes differences.
"""

import json
import os
import re
import subprocess
import tempfile
import time
import tomllib
from pathlib import Path

import mujoco
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from driver import ROOT
from fit_scipy import STEP, Poses
from row import check
from timing import Result

ROWS = 2773
GROUPS = "geometry,compliances"
SCENARIO = ROOT / "scenarios/ur10.toml"


def series() -> Path | None:
    folders = [Path(os.environ["ELASTOCAL_UR10_IPA"])] if "ELASTOCAL_UR10_IPA" in os.environ else []
    folders += [folder / "data/ur10_ipa" for folder in ROOT.parent.iterdir() if folder.is_dir()]
    return next((folder / "series_c.csv" for folder in folders if (folder / "series_c.csv").exists()), None)


def program() -> str:
    subprocess.run(["cargo", "build", "--release", "--locked", "--quiet"], cwd=ROOT, check=True)
    return str(ROOT / "target/release/elastocal")


def arm() -> dict:
    """The UR10 as its model says, as `Poses` takes it."""
    model = mujoco.MjModel.from_xml_path(str(ROOT / "models/ur10.xml"))
    compliance = tomllib.loads(SCENARIO.read_text())["robot"]["compliance_rad_per_nm"]

    def frame(position, quaternion):
        matrix = np.eye(4)
        matrix[:3, :3] = Rotation.from_quat(np.roll(quaternion, -1)).as_matrix()
        matrix[:3, 3] = position
        return matrix

    joints = [
        {
            "previous_from_link": frame(model.body_pos[body], model.body_quat[body]),
            "axis": model.jnt_axis[joint],
            "name": model.joint(joint).name,
            "mass_kg": model.body_mass[body],
            "centre_of_mass_m": model.body_ipos[body],
        }
        for joint, body in enumerate(model.jnt_bodyid)
    ]
    site = model.site("reflector").id
    tool = {"link_from_tool": frame(model.site_pos[site], model.site_quat[site])}
    return {
        "joints": joints,
        "calibration_tool": tool,
        "machining_tool": tool,
        "gravity_m_s2": model.opt.gravity,
        "compliance_rad_per_nm": compliance,
    }


def poses(q_rad, position_m, rotation, robot: dict, parameters: list[dict], sigma: list[float]) -> Poses:
    fit = {
        "payload": {"mass_kg": 0.0, "centre_of_mass_m": [0, 0, 0], "link": 5},
        "parameters": parameters,
        "q_rad": q_rad,
        "force_n": np.zeros((len(q_rad), 3)),
        "target": np.zeros(len(q_rad), dtype=int),
        "position_m": position_m,
        "rotation": rotation,
        "sigma_m": sigma[0],
        "sigma_rad": sigma[1],
    }
    return Poses(robot | {"fit": fit})


def made_up(file: Path) -> None:
    """Rows of a UR10 with errors, from a tracker somewhere."""
    random = np.random.default_rng(1)
    robot = arm()
    for joint in robot["joints"]:
        joint["previous_from_link"][:3, 3] += random.normal(0, 5e-4, 3)
        turn = Rotation.from_rotvec(random.normal(0, 5e-4, 3)).as_matrix()
        joint["previous_from_link"][:3, :3] = joint["previous_from_link"][:3, :3] @ turn
    q = random.uniform(-2.5, 2.5, (ROWS, 6))
    sigma = [2e-5, 5e-5]
    nothing = poses(q, np.zeros((ROWS, 3)), np.eye(3)[None].repeat(ROWS, 0), robot, [], sigma)
    position, turned = nothing.rest(
        nothing.turn,
        nothing.offset,
        nothing.tool_turn,
        nothing.tool_offset,
        nothing.mass,
        nothing.centre,
        nothing.compliance,
    )
    base = Rotation.from_rotvec([0.1, 0.2, 2.0])
    position = base.apply(position) + [3.0, -1.0, 0.5] + random.normal(0, sigma[0], (ROWS, 3))
    noise = Rotation.from_rotvec(random.normal(0, sigma[1], (ROWS, 3)))
    quaternion = np.roll((noise * base * Rotation.from_matrix(turned)).as_quat(), 1, axis=1)
    columns = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,qw,qx,qy,qz,sx_mm,sy_mm,sz_mm,srx_mrad,sry_mrad,srz_mrad"
    deviations = np.tile(np.repeat(np.array(sigma) * 1e3, 3), (ROWS, 1))
    table = np.hstack([np.degrees(q), position * 1e3, quaternion, deviations])
    np.savetxt(file, table, "%.12g", ",", header=columns, comments="")


def measured(file: Path, table: Path, elastocal: str) -> None:
    """The public table, through the mapping that the documentation shows."""
    text = (ROOT / "docs/other_programs.md").read_text()
    mapping = file.with_suffix(".toml")
    mapping.write_text(re.search(r"```toml file=ur10_tracker.toml\n(.*?)```", text, re.DOTALL)[1])
    words = [elastocal, "import", table, "--mapping", mapping, "--measurements-out", file, "--quiet"]
    subprocess.run(words, check=True, capture_output=True)


def identified(elastocal: str, file: Path, groups: str) -> tuple[dict, float]:
    words = [elastocal, "identify", SCENARIO, "--measurements", file, "--parameters", groups, "--json", "--quiet"]
    start = time.perf_counter()
    run = subprocess.run(words, capture_output=True, text=True)
    elapsed = time.perf_counter() - start
    assert run.returncode in (0, 3), run.stderr
    return json.loads(run.stdout), elapsed


def rows(file: Path):
    lines = [line for line in file.read_text().splitlines() if not line.startswith("#")]
    header = lines[0].split(",")
    values = [dict(zip(header, line.split(","))) for line in lines[1:]]
    of = lambda *columns: np.array([[float(row[column]) for column in columns] for row in values])
    q = np.radians(of(*[f"q{joint}_deg" for joint in range(1, 7)]))
    turned = Rotation.from_quat(np.roll(of("qw", "qx", "qy", "qz"), -1, axis=1)).as_matrix()
    return q, of("x_mm", "y_mm", "z_mm") * 1e-3, turned


def written(folder: str, elastocal: str) -> tuple[Path, str]:
    """The rows as a file, and what they are."""
    file, table = Path(folder) / "measurements.csv", series()
    if table is None:
        made_up(file)
        return file, "made-up rows"
    measured(file, table, elastocal)
    return file, "a laser tracker's rows"


def deviations(found: dict) -> list[float]:
    """Of positions (m) and rotations (rad), as the fit weighed them."""
    return [(found["discrepancy_mm"] or 0.02) * 1e-3, (found["discrepancy_mrad"] or 0.05) * 1e-3]


def beside_figaroh(name: str) -> list[Result]:
    """Geometry alone, by the whole workflow of either: from files to parameters."""
    import fit_figaroh

    elastocal = program()
    with tempfile.TemporaryDirectory() as folder:
        file, what = written(folder, elastocal)
        found, elapsed = identified(elastocal, file, "geometry")
        parameters, distance_m, peer_s = fit_figaroh.fitted(arm(), *rows(file), deviations(found), Path(folder))
        left_mm = found["distance_mm"]["mean"]
        if not distance_m * 1e3 < 1.01 * left_mm:
            # Not the same work: its time says nothing.
            ended = f"{what}: FIGAROH's fit ends where {1e3 * distance_m:.3f} mm are left after {peer_s:.0f} s, elastocal's"
            return [Result(name, "FIGAROH", skipped=f"{ended} where {left_mm:.3f} mm are, after {elapsed:.1f} s")]
        note = (
            f"{what}, geometry and frames: {len(found['unknowns'])} parameters leave {left_mm:.3f} mm, FIGAROH's"
            f" {parameters} leave {1e3 * distance_m:.3f} mm; FIGAROH is told weights"
        )
    return [Result(name, "FIGAROH", [elapsed], [peer_s], note=note)]


def beside_scipy(name: str, repetitions: int) -> list[Result]:
    elastocal = program()
    with tempfile.TemporaryDirectory() as folder:
        file, what = written(folder, elastocal)
        found, _ = identified(elastocal, file, GROUPS)
        result = Result(name, "SciPy least_squares")
        q, position, turned = rows(file)
        # In the base's own frame, as elastocal found it, so that the base's parameters count from none.
        base, target = found["stations"][0], found["targets"][0]
        station = Rotation.from_quat(np.roll(base["quaternion"], -1))
        position = station.inv().apply(position - np.array(base["position_mm"]) * 1e-3)
        turned = station.inv().as_matrix() @ turned
        robot = arm()
        tool = robot["calibration_tool"]["link_from_tool"]
        tool[:3, :3] = Rotation.from_quat(np.roll(target["quaternion"], -1)).as_matrix()
        tool[:3, 3] = np.array(target["position_mm"]) * 1e-3
        # Zeros of joints are rotations of the links that they move.
        fitted = [each for each in found["unknowns"] if each["standard_error"] is not None]
        sigma = deviations(found)
        scale = lambda each: each["nominal"] or (1e-3 if each["unit"] in ("m", "rad") else 1.0)
        names = [joint["name"] for joint in robot["joints"]]
        parameters = []
        for each in fitted:
            owner, what = each["name"].rsplit(".", 1)
            own = f"link_{names.index(owner) + 1}.rz" if what == "zero" else each["name"]
            parameters.append({"name": own, "nominal": each["nominal"], "scale": scale(each)})
        peer = poses(q, position, turned, robot, parameters, sigma)
        for _ in range(repetitions):
            result.ours_s.append(identified(elastocal, file, GROUPS)[1])
            start = time.perf_counter()
            peers = least_squares(peer.residuals, np.zeros(len(parameters)), diff_step=STEP, x_scale="jac")
            result.peer_s.append(time.perf_counter() - start)
        left = peer.residuals(peers.x)[: 3 * len(q)].reshape(-1, 3) * sigma[0] * 1e3
        distance_mm = np.linalg.norm(left, axis=1).mean()
        check("mean distance", distance_mm, found["distance_mm"]["mean"], 1e-3)
        _, whole_s = identified(elastocal, file, "all")
        result.note = (
            f"{what}: {len(found['unknowns'])} parameters leave {distance_mm:.3f} mm on both sides; elastocal as a whole"
            f" process, {whole_s:.2f} s with `--parameters all`; SciPy is told frames and weights"
        )
    return [result]
