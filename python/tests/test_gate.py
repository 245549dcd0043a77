"""The gate: renewed with a reason, passed, failed, and not judged."""

from __future__ import annotations

import shutil
from pathlib import Path
from xml.etree import ElementTree

import pytest

from elastocal import gate
from test_elastocal import PAPER

PLANS = Path(PAPER).parent / "plans"


def test_a_plan_is_held_against_its_baseline(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("klimchik2012_m3", "klimchik2012_m4"):
        shutil.copy(PLANS / f"{name}.csv", tmp_path)
    words = [str(PAPER), "--plans", f"{tmp_path}/*.csv", "--baselines", str(tmp_path / "baselines")]
    junit, summary = tmp_path / "report.xml", tmp_path / "summary.md"
    judged = [*words, "--junit", str(junit), "--summary", str(summary), "--annotations"]

    def counts() -> tuple[str | None, ...]:
        suite = ElementTree.parse(junit).getroot()
        return tuple(suite.get(key) for key in ("tests", "failures", "errors"))

    assert gate.main(judged) == 1 and counts() == ("2", "0", "2")
    assert "--renew REASON" in capsys.readouterr().err
    assert gate.main([*words, "--renew", " "]) == 2
    assert gate.main([*words, "--renew", "first baselines"]) == 0
    notes = (tmp_path / "baselines/CHANGES.md").read_text()
    assert notes.count("first baselines") == 2
    assert gate.main(judged) == 0 and counts() == ("2", "0", "0")
    # Nothing has changed: no note.
    assert gate.main([*words, "--renew", "again"]) == 0
    assert (tmp_path / "baselines/CHANGES.md").read_text() == notes
    # A plan that cannot be judged keeps no note of the others back, and a folder that is not there is named.
    (tmp_path / "a.csv").write_text((tmp_path / "klimchik2012_m3.csv").read_text().replace("-2500", "-2400"))
    (tmp_path / "z.csv").write_text("no plan")
    assert gate.main([*words, "--renew", "two more"]) == 1
    assert (tmp_path / "baselines/CHANGES.md").read_text().count("two more") == 1
    assert gate.main([*judged, "--junit", str(tmp_path / "none/report.xml")]) == 1
    assert "none/report.xml" in capsys.readouterr().err
    (tmp_path / "a.csv").unlink()
    (tmp_path / "z.csv").unlink()
    plan = tmp_path / "klimchik2012_m3.csv"
    plan.write_text(plan.read_text().replace("-2500", "-1500"))
    capsys.readouterr()
    assert gate.main(judged) == 3 and counts() == ("2", "1", "0")
    said = capsys.readouterr()
    assert f"::error file={plan}" in said.out and "rho0" in said.err
    assert "rho0" in summary.read_text()
