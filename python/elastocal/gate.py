"""Plans against their baselines, for continuous integration: ``python -m elastocal.gate SCENARIO --plans 'plans/*.csv'``.

Each plan is evaluated, and compared with ``BASELINES/<plan>.json`` by the tolerances of the scenario's table ``[gate]``.
``--renew REASON`` makes the results of today the baselines, and writes what changed and why to ``BASELINES/CHANGES.md``.

Exit codes: 0 within tolerance, 1 a plan could not be judged, 2 wrong usage, 3 changed beyond tolerance.
"""

from __future__ import annotations

import argparse
import glob
import json
import os
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import elastocal as ec
from elastocal._errors import write_whole

#: Differences of the question that renewing puts up with.
RENEWABLE = ["scenario", "seed", "experiments", "configurations", "criterion", "errors", "inputs"]
#: Units in which people read, and how many of them one is.
SHOWN = {"rad/(N m)": ("1e-9 rad/(N m)", 1e9)}


@dataclass
class Verdict:
    """What became of a plan: ``code`` as the program's exit codes, and what to say about it."""

    plan: Path
    code: int
    problems: list[str]
    summary: str
    record: dict[str, Any] = field(default_factory=dict)


def main(words: list[str] | None = None) -> int:
    """Judges the plans, or renews their baselines."""
    asked = arguments().parse_args(words)
    try:
        return judge(asked)
    except OSError as error:
        print(f"error: {error.filename}: {error.strerror}", file=sys.stderr)
        return 1


def judge(asked: argparse.Namespace) -> int:
    """The same with words that were understood."""
    plans = sorted({Path(found) for pattern in asked.plans for found in glob.glob(pattern)})
    if not plans:
        print(f"error: no plan is found at {' '.join(asked.plans)}", file=sys.stderr)
        return 1
    if len({plan.stem for plan in plans}) < len(plans):
        print("error: two plans have the same name, and so the same baseline", file=sys.stderr)
        return 1
    if asked.renew is not None:
        if not asked.renew.strip():
            print("error: --renew wants the reason why results may change", file=sys.stderr)
            return 2
        return renew(asked, plans)
    names = {plan.stem for plan in plans}
    for baseline in sorted(asked.baselines.glob("*.json")):
        if baseline.stem not in names:
            print(f"note: {baseline} has no plan at {' '.join(asked.plans)}", file=sys.stderr)
    verdicts = [judged(asked, plan) for plan in plans]
    for verdict in verdicts:
        print(verdict.summary)
        for problem in verdict.problems:
            print(f"{verdict.plan}: {problem}", file=sys.stderr)
            if asked.annotations:
                print(annotation(verdict.plan, problem))
    if asked.summary:
        with open(asked.summary, "a", encoding="utf-8") as file:
            file.write("\n".join(verdict.summary for verdict in verdicts))
    if asked.junit:
        asked.junit.write_text(junit(asked.scenario, verdicts), encoding="utf-8")
    return max((verdict.code for verdict in verdicts), key=[0, 3, 1].index)


def arguments() -> argparse.ArgumentParser:
    """What the command line takes."""
    parser = argparse.ArgumentParser(prog="python -m elastocal.gate", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("scenario", type=Path, help="the scenario file")
    parser.add_argument("--plans", nargs="+", required=True, metavar="PATTERN", help="plan files; patterns such as 'plans/*.csv'")
    parser.add_argument("--baselines", type=Path, default=Path("baselines"), help="the folder of baselines (baselines)")
    parser.add_argument("--noise-only", action="store_true", help="believe in the instrument's noise alone")
    parser.add_argument("--summary", type=Path, metavar="FILE", help="append a summary in Markdown")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="write a report in JUnit's XML")
    parser.add_argument(
        "--annotations", action="store_true", default="GITHUB_ACTIONS" in os.environ, help="print GitHub's annotations"
    )
    parser.add_argument("--renew", metavar="REASON", help="make today's results the baselines, and note why")
    return parser


def evaluated(asked: argparse.Namespace, plan: Path) -> ec.Results:
    """The record of a plan."""
    return ec.command("evaluate", asked.scenario, plan=plan, noise_only=asked.noise_only)


def compared(baseline: Path, found: ec.Results, **given: Any) -> tuple[ec.Results, str]:
    """A record against a baseline: the comparison, and its summary in Markdown."""
    with tempfile.TemporaryDirectory(prefix="elastocal-") as name:
        new, summary = Path(name, "new.json"), Path(name, "summary.md")
        write(new, found)
        return ec.compare(baseline, new, markdown=summary, **given), summary.read_text(encoding="utf-8")


def write(path: Path, record: dict[str, Any]) -> None:
    """Writes a record."""
    write_whole(path, json.dumps(record, indent=2) + "\n", (".json",))


def judged(asked: argparse.Namespace, plan: Path) -> Verdict:
    """A plan against its baseline."""
    title = f"### {plan}\n\n"
    baseline = asked.baselines / f"{plan.stem}.json"
    try:
        found = evaluated(asked, plan)
        if not baseline.exists():
            raise ec.ElastocalError(f"{baseline} is not there", "--renew REASON makes it from the results of today")
        comparison, summary = compared(baseline, found)
    except ec.ElastocalError as error:
        hint = error.hint
        if hint and "allow_different" in hint:
            hint = "--renew REASON makes the results of today the baseline"
        problem = str(error) + (f"; {hint}" if hint else "")
        return Verdict(plan, 1, [problem], f"{title}Not judged: {problem}\n")
    broken = [told(change) for change in comparison["changes"] if not change["ok"]]
    return Verdict(plan, 3 if broken else 0, broken, title + summary, comparison)


def told(change: dict[str, Any]) -> str:
    """A change in words."""
    unit, scale = SHOWN.get(change["unit"], (change["unit"], 1.0))
    sides = ["null" if change[side] is None else f"{change[side] * scale:.6g}" for side in ("base", "new")]
    of = f" of {change['of']}" if change["of"] else ""
    relative = change["relative_change"]
    by = f" ({relative * 100:+.2g} %)" if relative is not None else ""
    return f"{change['quantity']}{of} {sides[0]} -> {sides[1]}{f' {unit}' if unit else ''}{by}"


def annotation(plan: Path, problem: str) -> str:
    """A line that GitHub shows beside the plan."""
    text = problem.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
    file = str(plan).replace("%", "%25").replace(":", "%3A").replace(",", "%2C")
    return f"::error file={file},title=elastocal::{text}"


def junit(scenario: Path, verdicts: list[Verdict]) -> str:
    """A test case for each plan."""
    cases = []
    for verdict in verdicts:
        kind = {0: None, 1: "error", 3: "failure"}[verdict.code]
        text = "\n".join(verdict.problems)
        inner = f"<{kind} message={quoteattr(text)}>{escape(verdict.summary)}</{kind}>" if kind else ""
        cases.append(f"  <testcase classname={quoteattr(scenario.stem)} name={quoteattr(str(verdict.plan))}>{inner}</testcase>\n")
    failures, errors = (sum(verdict.code == code for verdict in verdicts) for code in (3, 1))
    head = f'name="elastocal" tests="{len(verdicts)}" failures="{failures}" errors="{errors}"'
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<testsuite {head}>\n{"".join(cases)}</testsuite>\n'


def renew(asked: argparse.Namespace, plans: list[Path]) -> int:
    """Makes today's results the baselines where a number has changed."""
    asked.baselines.mkdir(parents=True, exist_ok=True)
    notes, code = [], 0
    for plan in plans:
        baseline = asked.baselines / f"{plan.stem}.json"
        try:
            found = evaluated(asked, plan)
        except ec.ElastocalError as error:
            print(f"error: {error}", *([f"hint: {error.hint}"] if error.hint else []), sep="\n", file=sys.stderr)
            code = 1
            continue
        what = changes(baseline, found)
        if what is None:
            print(f"{plan}: nothing has changed: its baseline stays")
            continue
        write(baseline, found)
        print(f"{plan}: {what}")
        notes.append(f"- {plan.stem}: {what}: {' '.join(asked.renew.split())}\n")
    if notes:
        with open(asked.baselines / "CHANGES.md", "a", encoding="utf-8") as file:
            file.writelines(notes)
    return code


def changes(baseline: Path, found: ec.Results) -> str | None:
    """What differs from a baseline, in words; none where it answers the same question with the same numbers."""
    if not baseline.exists():
        return "first baseline"
    try:
        comparison, _ = compared(baseline, found, allow_different=RENEWABLE)
    except ec.ElastocalError as error:
        return f"replaced as a whole ({error})"
    other = [each["setting"] for each in comparison["allowed_differences"]]
    if comparison["identical"] and not other:
        return None
    numbers = [told(change) for change in comparison["changes"] if change["base"] != change["new"]]
    return "; ".join([f"another {setting}" for setting in other] + (numbers or ["no number has changed"]))


if __name__ == "__main__":
    sys.exit(main())
