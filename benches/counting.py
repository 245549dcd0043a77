"""Counts the instructions of elastocal's hot paths with valgrind, which no neighbour on the machine disturbs.

Valgrind shows the program AVX2 but not AVX-512; where the code has a version for each, the former is counted.
"""

import os
import platform
import re
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from shutil import which

# Incremental builds cut the code into other units, which has other counts.
os.environ["CARGO_INCREMENTAL"] = "0"
# A model that is kept takes fewer instructions to load than one that is compiled.
os.environ["ELASTOCAL_CACHE"] = ""

from peers.driver import ROOT, executable


class Missing(Exception):
    """Counting is not possible here."""


def first_line(command: list[str]) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[0]


def where() -> dict[str, str]:
    """What counts depend on beside the code."""
    if which("valgrind") is None:
        raise Missing("valgrind is not installed (Debian, Ubuntu: apt install valgrind)")
    cpuinfo = Path("/proc/cpuinfo")
    flags = cpuinfo.read_text().split() if cpuinfo.exists() else []
    return {
        "machine": platform.machine(),
        "avx2": "yes" if "avx2" in flags and "fma" in flags else "no",
        "rustc": first_line(["rustc", "--version"]),
        "cc": first_line([os.environ.get("CC", "cc"), "--version"]),
        "libc": " ".join(platform.libc_ver()),
        "valgrind": first_line(["valgrind", "--version"]),
    }


class Counter:
    def __init__(self) -> None:
        self.driver = executable()

    def total(self, path: str, times: int, *options: str) -> int:
        """Instructions of a process that does a path's work so many times."""
        command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null"]
        command += [self.driver, "repeat", path, str(times), *options]
        run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
        found = re.search(r"Collected : (\d+)", run.stderr)
        if run.returncode != 0 or found is None:
            raise SystemExit(f"error: counting {path} failed:\n{run.stderr}")
        return int(found[1])

    def each(self, path: str, times: int, *options: str) -> float:
        """Instructions of the work done once: what more of it costs beside starting and preparing."""
        return (self.total(path, times, *options) - self.total(path, 0)) / times

    def all(self, repetitions: dict[str, int]) -> dict[str, float]:
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            return dict(zip(repetitions, pool.map(self.each, repetitions, repetitions.values())))
