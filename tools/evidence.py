#!/usr/bin/env python3
"""Predicted and observed accuracy on robots that are sampled in every run: docs/evidence.md.

    tools/evidence.py                    all rows, some ten minutes of two cores; writes docs/evidence.md
    tools/evidence.py --only gap hidden   these tables alone; the others stay as the page has them
    tools/evidence.py --missing          the rows that the page does not have; the others stay as they are there
    tools/evidence.py --check            some rows again: they must agree with the page

Every row is a study of `elastocal` on the virtual robot in MuJoCo, with everything drawn that the row names.
"""

import argparse
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "evidence.md"
PROGRAM = ROOT / "target" / "release" / "elastocal"
RUNS = 20_000
# The largest gaps are seen in so many parts.
PARTS = 12

ROBOTS = {
    "KR-270": ("klimchik2012.toml", "joint_1", True),
    "UR10": ("ur10.toml", "shoulder_pan", True),
    "planar arm": ("planar_3r.toml", None, False),
}

# Kinds with sizes that a laboratory would recognise.
SOURCES = {
    "compliance of the first joint": 'kind = "compliance"\njoints = ["{first}"]\nstd_relative = 0.15',
    "joint_repeatability": 'kind = "joint_repeatability"\nstd_mrad = 0.0485',
    "joint_zero": 'kind = "joint_zero"\nstd_mrad = 0.2',
    "link_position": 'kind = "link_position"\nstd_mm = 0.3',
    "link_rotation": 'kind = "link_rotation"\nstd_mrad = 0.2',
    "link_mass": 'kind = "link_mass"\nstd_relative = 0.1',
    "tool_position": 'kind = "tool_position"\nstd_mm = 0.3',
    "base_rotation": 'kind = "base_rotation"\nstd_mrad = 0.2',
    "load_scale": 'kind = "load_scale"\nstd_relative = 0.01',
    "load_offset": 'kind = "load_offset"\nstd_n = 5',
    "load_direction": 'kind = "load_direction"\nstd_mrad = 2',
    "load_point": 'kind = "load_point"\nstd_mm = 2',
    "task_force": 'kind = "task_force"\nstd_relative = 0.05',
    "transmission_error": 'kind = "transmission_error"\nstd_mrad = 0.3',
    "discrepancy": 'kind = "discrepancy"\nstd_mm = 0.02',
    "tracker_range": 'kind = "tracker_range"\nstd_um_per_m = 3',
}
# The same in rows of their own: "all of these" is without them.
ALONE = {
    "drift": 'kind = "drift"\nstd_um_per_h = 20',
    "backlash": 'kind = "backlash"\nstd_arcsec = 15\nturned_over_at_nm = {turning}',
    "stiffening": 'kind = "stiffening"\nstd_relative = 0.01\nat_nm = {carried}',
    "gear waves": 'kind = "transmission_error"\nname = "gear waves"\nstd_mrad = 0.5\nharmonics = [1, 2, 40]',
}
# What two loaded readings share that have one unloaded reading, with how joints came back for that.
UNLOADED = "one unloaded reading"
# Some percent of what each robot's joints carry, from where on that decides on which side of a gap one stands, and most of it.
TORQUES = {"KR-270": ("100", "8000"), "UR10": ("10", "200"), "planar arm": ("20", "600")}
# The planar arm has no tracker, and no first joint that nothing bends.
LACKING = {"planar arm": {"compliance of the first joint", "tracker_range"}}
# Where the linear model is furthest off: what is spread, with the sizes of it, each half of the one before, and the gap (as a share of the
# prediction) that is expected of a size, where it is known.
GAPS = {
    "compliance of the first joint": ([0.15, 0.075], 'kind = "compliance"\njoints = ["{first}"]\nstd_relative = {size}',
                                      lambda size: f"{0.875 * size ** 2:+.2%}"),
    "stiffening of all joints": ([0.02, 0.01, 0.005], 'kind = "stiffening"\nstd_relative = {size}\nat_nm = {carried}', None),
}
# Joints of the virtual robot that are no springs, of one robot.
LAWS = {
    "stiffens at 5 mrad": "stiffens_at_mrad = 5",
    "softens at 20 mrad": "softens_at_mrad = 20",
}
HEAVY = "KR-270"
# Absolute readings: how many, what they are uncertain by, and how many robots are read.
READINGS = 16
ABSOLUTE = ['kind = "joint_repeatability"\nstd_mrad = 0.0485', 'kind = "transmission_error"\nstd_mrad = 0.05',
            'kind = "link_position"\nstd_mm = 0.1']
READ_AS = ["positions", "poses"]
ROBOTS_READ = 1_000
LAW_RUNS = 1_000


def sources(robot, alone=False):
    """The rows of a robot, together or each alone."""
    first = ROBOTS[robot][1]
    lacking = LACKING.get(robot, set())
    listed = SOURCES | ALONE if alone else SOURCES
    turning, carried = TORQUES[robot]
    places = {"{first}": first or "", "{turning}": turning, "{carried}": carried}

    def fill(text):
        for place, value in places.items():
            text = text.replace(place, value)
        return text

    filled = {name: fill(text) for name, text in listed.items()}
    return {name: text for name, text in filled.items() if name not in lacking}


def scenario(robot, uncertainties, hidden, level="robot", more=""):
    """The robot's scenario with a study of its best plan for noise alone, of four measurements twice."""
    text = (ROOT / "scenarios" / ROBOTS[robot][0]).read_text()
    text = text.split("\n[[plan]]")[0].split("\n[study]")[0].split("\n[gate")[0]
    text = text.replace('"../models/', f'"{ROOT}/models/')
    if 'tracker_site' not in text and ROBOTS[robot][2]:
        text = text.replace("[instrument]", '[instrument]\ntracker_site = "tracker"')
    study = f'\n[study]\nlevel = "{level}"\nexperiments = 8\n[[study.plan]]\nname = "plan"\nkind = "optimal"\n' \
            "experiments = 4\nnoise_only = true\n"
    mark = "\nhidden = true" if hidden else ""
    return text + study + more + "".join(f"\n[[uncertainty]]\n{each}{mark}\n" for each in uncertainties)


def study(robot, uncertainties, hidden, *options, level="robot", runs=RUNS, more="", instrument=""):
    """What a study says of the plan."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "evidence.toml"
        text = scenario(robot, uncertainties, hidden, level, more)
        path.write_text(text.replace("[instrument]", "[instrument]\n" + instrument))
        command = [PROGRAM, "study", path, "--trials", str(runs), "--json", "--quiet", "--out", folder, *options]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        if ended.returncode not in (0, 3):
            sys.exit(f"{robot}, {uncertainties}: {ended.stderr}")
        return json.loads(ended.stdout)["plans"][0]


def held(robot, name):
    """A row of what holds: what the belief knows of."""
    if name == UNLOADED:
        plan = study(robot, [SOURCES["joint_repeatability"]], hidden=False, instrument='unloaded = "shared"')
    else:
        listed = sources(robot).values() if name == "all of these" else [sources(robot, alone=True)[name]]
        plan = study(robot, listed, hidden=False)
    predicted, seen, error = (plan[key] * 1e3 for key in ("combined_rms_mm", "rms_mm", "rms_std_mm"))
    room = 3 * error + 0.02 * predicted
    nees = plan["nees"] / plan["nees_expected"]
    return [robot, name, f"{predicted:.3f}", f"{seen:.3f} +- {error:.3f}", f"{seen / predicted - 1:+.2%}",
            f"{nees:.3f}", f"{plan['coverage95']:.1%}", "yes" if abs(seen - predicted) <= room else "**no**"]


def hidden(robot, name):
    """A row of what breaks: what the belief does not know of."""
    plan = study(robot, [sources(robot, alone=True)[name]], hidden=True)
    predicted, seen, error = (plan[key] * 1e3 for key in ("combined_rms_mm", "rms_mm", "rms_std_mm"))
    expected = math.hypot(*(each["contribution_um"] for each in plan["contributions"]))
    return [robot, name, f"{predicted:.3f}", f"{seen:.3f} +- {error:.3f}", f"{expected:.3f}", f"{seen / predicted:.2f}"]


def laws(robot, name):
    """A row of joints that are no springs, of which no belief knows: the first two that are identified."""
    joints = ",".join(identified(robot).split(",")[:2])
    text = f"\n[[true_robot.torque_law]]\njoints = [{joints}]\n{LAWS[name]}\n"
    plan = study(robot, [], False, runs=LAW_RUNS, more=text)
    predicted, seen, error = (plan[key] * 1e3 for key in ("combined_rms_mm", "rms_mm", "rms_std_mm"))
    expected = math.hypot(*(each["contribution_um"] for each in plan["contributions"]))
    return [robot, name, f"{predicted:.3f}", f"{seen:.3f} +- {error:.3f}", f"{expected:.3f}", f"{seen / predicted:.2f}"]


def gap(robot, name):
    """A row of the largest gaps: runs in parts, each beside the linear model's with the same random numbers."""
    what, size = name.rsplit(", ", 1)
    size = float(size.rstrip(" %")) / 100
    _, text, expected = GAPS[what]
    places = {"{first}": ROBOTS[robot][1] or "", "{carried}": TORQUES[robot][1], "{size}": str(size)}
    for place, value in places.items():
        text = text.replace(place, value)
    found = []
    for seed in range(1, PARTS + 1):
        seen, model = (study(robot, [text], False, "--seed", str(seed), level=level, runs=RUNS // 4)
                       for level in ("robot", "model"))
        predicted = seen["combined_rms_mm"]
        found.append((seen["rms_mm"] ** 2 - model["rms_mm"] ** 2) / (2 * predicted ** 2))
    mean = sum(found) / PARTS
    error = math.sqrt(sum((each - mean) ** 2 for each in found) / (PARTS - 1) / PARTS)
    return [robot, name, f"{predicted * 1e3:.3f}", f"{mean:+.2%} +- {error:.2%}", expected(size) if expected else "-"]


def absolute(robot, name):
    """A row of where the loaded tool is: the best plan that is found at drawn configurations, read by virtual robots."""
    text = scenario(robot, ABSOLUTE, False).split("\n[study]")
    uncertain = text[1][text[1].index("\n[[uncertainty]]"):]
    text = re.sub(r"experiments = \d+", f"experiments = {READINGS}", text[0])
    text = text.replace("[design]", '[design]\naccuracy = "absolute"')
    if name.startswith("poses"):
        text = text.replace("[instrument]", "[instrument]\nrotation_sigma_mrad = 0.1")
    text += f'\n[study]\ntrials = {ROBOTS_READ}\n[[study.plan]]\nkind = "optimal"\nname = "plan"\n' + uncertain
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "evidence.toml"
        path.write_text(text)
        command = [PROGRAM, "study", path, "--parameters", "zeros", "--draw", "20", "--json", "--quiet", "--out", folder]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        if ended.returncode not in (0, 3):
            sys.exit(f"{robot}, {name}: {ended.stderr}")
        plan = json.loads(ended.stdout)["plans"][0]
    predicted, seen, error = (plan[key] * 1e3 for key in ("combined_rms_mm", "rms_mm", "rms_std_mm"))
    return [robot, name, f"{predicted:.3f}", f"{seen:.3f} +- {error:.3f}", f"{seen / predicted - 1:+.2%}",
            f"{plan['nees'] / plan['nees_expected']:.3f}", f"{plan['coverage95']:.1%}",
            "yes" if plan["verdict"] == "holds" else f"**{plan['verdict']}**"]


def identified(robot):
    """The joints that a robot's scenario identifies, as it lists them."""
    return re.search(r"parameters = \[(.*?)\]", (ROOT / "scenarios" / ROBOTS[robot][0]).read_text()).group(1)


TABLES = {
    "held": (held, ["robot", "error source", "predicted [um]", "observed [um]", "off by", "NEES / expected", "coverage of 95 %",
                     "holds"]),
    "absolute": (absolute, ["robot", "read are", "predicted [um]", "observed [um]", "off by", "NEES / expected",
                            "coverage of 95 %", "holds"]),
    "gap": (gap, ["robot", "spread of", "predicted [um]", "off by", "7/8 of the spread's square"]),
    "hidden": (hidden, ["robot", "hidden source", "predicted [um]", "observed [um]", "computed [um]", "observed / predicted"]),
    "laws": (laws, ["robot", "joints", "predicted [um]", "observed [um]", "computed [um]", "observed / predicted"]),
}


def rows(table):
    """All rows of a table, as arguments."""
    for robot in ROBOTS:
        if table == "gap":
            names = [f"{what}, {size:.2%}".replace("%", " %") for what, (sizes, _, _) in GAPS.items() for size in sizes
                     if robot == HEAVY or (what in SOURCES and ROBOTS[robot][1])]
        elif table == "absolute":
            names = READ_AS
        elif table == "laws":
            names = list(LAWS) if robot == HEAVY else []
        else:
            names = list(sources(robot)) + (["all of these"] if table == "held" else [])
            names += list(ALONE) + ([UNLOADED] if table == "held" else [])
        yield from ((robot, name) for name in names)


def line(cells):
    return "| " + " | ".join(cells) + " |\n"


def agrees(row, stored):
    """Whether a row of the page is this one. Another processor may find another plan that is as good: what is predicted
    may differ by 0.1 %, what is seen by four standard errors."""
    if len(stored) != len(row) or stored[:2] != row[:2]:
        return False
    (seen, error), (before, _) = ([float(part) for part in each[3].split(" +- ")] for each in (row, stored))
    return abs(float(row[2]) / float(stored[2]) - 1) < 1e-3 and abs(seen - before) <= 4 * error + 1e-3


SECTIONS = {
    "held": f"""# Evidence: prediction and simulation

`make evidence` makes this page: every row is {RUNS} runs of the whole loop on the virtual robot in MuJoCo, sampled anew in every run.
Plans are the best for noise alone, four measurements, each twice. A row *holds* if the observed rms is within three standard errors and
2 % of the predicted one: the model is linear, and the virtual robot is not. NEES is the mean square of the estimation error in units of
its own covariance, over its expectation. It is not one for a load cell of the UR10 that is 5 N off at 98 N (the offset multiplies
compliances), and for joints of the KR-270 that carry more than the torque at which they stiffen; intervals and predictions hold. Drift,
backlash with `turned_over_at_nm`, stiffening and harmonics are in rows of their own: "all of these" is without them. So is one unloaded
reading (`unloaded = "shared"`), with joint repeatability.

## Error sources that the planner's model has

""",
    "absolute": f"""
## Absolute accuracy

The same of [absolute plans](absolute_plans.md): {READINGS} readings at sampled configurations, from which joint zeros and all
frames are identified, with a joint repeatability of 0.0485 mrad, transmission errors of 0.05 mrad, and links known to 0.1 mm.
{ROBOTS_READ} robots each. NEES and coverage are of the tool's place.

""",
    "gap": f"""
## Where the model is not linear

The largest gaps: a log-normal compliance of a joint that no measurement shows, where the linear model misses 7/8 of the spread's square,
beside shares by which all joints of the KR-270 stiffen, or soften, at 8000 N m, of which its second one carries more: fits and compensation
have the whole law. {PARTS * RUNS // 4} runs, each with the random numbers of the linear model's.

""",
    "hidden": """
## Error sources that the planner's model does not have

The same plans, planned for the noise alone. *Computed* is the uncertainty budget with the hidden source.

""",
    "laws": f"""
## Nonlinear joint stiffness

The same plans, on a virtual robot of which joints 2 and 3 have another [law](joint_errors.md#on-the-virtual-robot):
{LAW_RUNS} runs each. The budget has it to first order.

""",
}


def page(found):
    text = ""
    for table, (_, header) in TABLES.items():
        text += SECTIONS[table] + line(header) + line(["---"] * len(header)) + "".join(line(row) for row in found[table])
    return text


def shown(name):
    """The second cell of a row."""
    return name if isinstance(name, str) else f"{name:.2%}"


def stored(table, may_lack=False):
    """The rows of a table as the page has them."""
    lines = PAGE.read_text().splitlines()
    header = line(TABLES[table][1]).strip()
    if header not in lines and may_lack:
        return []
    if header not in lines:
        sys.exit(f"error: {PAGE.name} has no table {table}\nhint: --only {table}, too")
    found = []
    for each in lines[lines.index(header) + 2:]:
        if not each.startswith("|"):
            break
        found.append([cell.strip() for cell in each.strip("|").split("|")])
    return found


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--check", action="store_true", help="some rows again, against the page")
    arguments.add_argument("--missing", action="store_true", help="the rows that the page does not have alone")
    arguments.add_argument("--only", nargs="+", choices=list(TABLES), help="these tables alone")
    given = arguments.parse_args()
    if given.check:
        for table, robot, name in [("held", "UR10", "load_scale"), ("held", "KR-270", "backlash"),
                                   ("absolute", "planar arm", "positions"), ("hidden", "UR10", "joint_repeatability"),
                                   ("laws", "KR-270", "softens at 20 mrad")]:
            row = TABLES[table][0](robot, name)
            if not any(agrees(row, other) for other in stored(table)):
                sys.exit(f"error: {PAGE.name} has no row that agrees with\n{line(row)}hint: make evidence")
            print(line(row), end="")
        return
    found = {table: [] for table in TABLES}
    wanted = given.only or list(TABLES)
    for table in TABLES:
        if table not in wanted:
            found[table] = stored(table)
            continue
        known = stored(table, may_lack=True) if given.missing else []
        for robot, name in rows(table):
            same = [row for row in known if row[0] == robot and row[1] == shown(name)]
            if same:
                found[table].append(same[0])
                continue
            row = TABLES[table][0](robot, name)
            print(line(row), end="", flush=True)
            found[table].append(row)
    PAGE.write_text(page(found))
    print(f"wrote {PAGE}")


if __name__ == "__main__":
    main()
