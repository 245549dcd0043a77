#!/usr/bin/env python3
"""Copies what is handed on beside the program to a folder: scenarios, their plans, models, and the proofs' checker."""

import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def share(folder: Path) -> None:
    """Replaces the folder by what is shared."""
    shutil.rmtree(folder, ignore_errors=True)
    for name in ("models", "scenarios"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("baselines"))
    shutil.copy2(ROOT / "tools/check_proof.py", folder / "check_proof.py")


if __name__ == "__main__":
    share(Path(sys.argv[1]))
