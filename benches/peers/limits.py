"""What bounds each of elastocal's hot paths from below, as far as it can be told: a name, the driver's path
that does only the bounding work, and how much of it the hot path needs."""

from pathlib import Path


def limits(problem: dict) -> dict[str, tuple[str, str, float]]:
    flops = problem["flops_per_unit"]
    stages = problem["equilibrium"]["position_stages"]
    robot = 64 * problem["equilibrium"]["position_stages_of_run"]
    position_stage = "MuJoCo's position stage"
    result = {
        "equilibrium": (position_stage, "position_stage", stages[1]),
        "measurement": (position_stage, "position_stage", sum(stages)),
        "measurement_flexible": (position_stage, "position_stage_flexible", problem["flexible"]["position_stages"]),
        "study_model": ("normal numbers", "normals", 1),
        "study_robot": (position_stage, "position_stage", robot),
    }
    for size, plan in problem["plans"].items():
        m, p = int(size), len(problem["parameters"])
        # Counted in the C program of search_scipy.py: about so many for an experiment, and for the rest.
        result[f"objective_{m}"] = ("flops of a core", "flops", (1200 * m + 600) / flops)
        # The normal equations alone.
        result[f"identify_linear_{m}"] = ("flops of a core", "flops", 6 * m * p * p / flops)
        calls = plan["nonlinear"]["kinematics_calls"]
        result[f"identify_nonlinear_{m}"] = ("forward kinematics", "kinematics", calls)
    for kind in ["mcap", "rrd"]:
        size = Path(problem["recordings"][kind]).stat().st_size
        result[kind] = ("writing the bytes", f"write_{size}", 1)
    return result
