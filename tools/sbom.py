#!/usr/bin/env python3
"""Prints what is compiled into the program and what comes with it, as CycloneDX 1.5: name, version, licence, checksum."""

import json
import os
import platform
import re
import subprocess
import sys
from pathlib import Path

try:
    import tomllib
except ImportError:  # Before Python 3.11, pip has it.
    from pip._vendor import tomli as tomllib

ROOT = Path(__file__).resolve().parent.parent


def compiled() -> list[dict]:
    """The crates that are compiled in on this machine: no tests' and no build scripts'."""
    target = f"{platform.machine()}-unknown-linux-gnu"
    command = [os.environ.get("CARGO", "cargo"), "metadata", "--locked", "--format-version=1", "--filter-platform", target]
    metadata = json.loads(subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, check=True).stdout)
    packages = {package["id"]: package for package in metadata["packages"]}
    needs = {
        node["id"]: [each["pkg"] for each in node["deps"] if any(kind["kind"] is None for kind in each["dep_kinds"])]
        for node in metadata["resolve"]["nodes"]
    }
    found, ahead = set(), [metadata["resolve"]["root"]]
    while ahead:
        package = ahead.pop()
        if package not in found:
            found.add(package)
            ahead += needs[package]
    return sorted((packages[each] for each in found), key=lambda each: (each["name"], each["version"]))


def component(package: dict, checksums: dict) -> dict:
    name, version = package["name"], package["version"]
    made = {"type": "library", "name": name, "version": version, "purl": f"pkg:cargo/{name}@{version}"}
    if package["license"]:
        made["licenses"] = [{"expression": package["license"].replace("/", " OR ")}]
    if checksum := checksums.get((name, version)):
        made["hashes"] = [{"alg": "SHA-256", "content": checksum}]
    return made


def main() -> None:
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text())
    checksums = {(each["name"], each["version"]): each.get("checksum") for each in lock["package"]}
    crates = compiled()
    [own] = [each for each in crates if each["name"] == "elastocal"]
    [mujoco] = re.findall(r"^mujoco==([\d.]+)", (ROOT / "tools/mujoco-requirements.txt").read_text(), flags=re.MULTILINE)
    library = {"type": "library", "name": "mujoco", "version": mujoco, "purl": f"pkg:pypi/mujoco@{mujoco}"}
    library["licenses"] = [{"expression": "Apache-2.0"}]
    document = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": component(own, checksums) | {"type": "application"}},
        "components": [component(each, checksums) for each in crates if each is not own] + [library],
    }
    json.dump(document, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
