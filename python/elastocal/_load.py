"""MuJoCo's library comes from pip's package, and is there before what is linked against it."""

from __future__ import annotations

import ctypes
import importlib.util
from pathlib import Path

#: The version that elastocal is built for.
MUJOCO = "3.17.0"


def preload() -> None:
    """Loads ``libmujoco.so`` of the package ``mujoco``."""
    spec = importlib.util.find_spec("mujoco")
    if spec is None or not spec.submodule_search_locations:
        raise ImportError(f"elastocal needs MuJoCo: pip install mujoco=={MUJOCO}")
    library = Path(spec.submodule_search_locations[0]) / f"libmujoco.so.{MUJOCO}"
    if not library.exists():
        raise ImportError(f"elastocal needs MuJoCo {MUJOCO}, which is not what is installed: pip install mujoco=={MUJOCO}")
    ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
