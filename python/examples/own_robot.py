"""From a robot's model (URDF or MJCF) to a plan, measurements of it and what they tell.

    python examples/own_robot.py robot.urdf
"""

import sys
import tempfile
from pathlib import Path

import elastocal as ec


def main(model: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        scenario = ec.init(model, Path(folder) / "robot.toml")
        for warning in scenario.check()["warnings"]:
            print("warning:", warning)
        design = scenario.design(experiments=4, no_proof=True)
        print(repr(design))
        identified = scenario.identify(scenario.measure(design.plan))
        for name, value, error in zip(
            identified.names, identified.compliance_rad_per_nm, identified.compliance_std_rad_per_nm
        ):
            print(f"{name}: {value:.3e} +- {error:.1e} rad/(N m)")
        print("angles to command [deg]:", scenario.compensate(identified).q_commanded_deg)


if __name__ == "__main__":
    main(*sys.argv[1:] or ["models/spatial_3r.xml"])
