"""What several tests need."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture
def series_c(monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder with readings of a real UR10, which the project does not hold: named by ELASTOCAL_UR10_IPA, or beside the project."""
    beside = Path(__file__).resolve().parents[3].glob("*/data/ur10_ipa")
    for folder in [Path(os.environ.get("ELASTOCAL_UR10_IPA", "/nonexistent")), *sorted(beside)]:
        if (folder / "series_c.csv").exists():
            monkeypatch.setenv("ELASTOCAL_UR10_IPA", str(folder))
            return folder
    pytest.skip("series_c.csv of ipa-robot-accuracy is not there; ELASTOCAL_UR10_IPA can name its folder")
