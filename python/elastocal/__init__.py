"""Plans of calibration experiments for the joint stiffness of robots.

A :class:`Scenario` is what a robot's calibration is about: the model, what must be accurate and where, the loads and
the instrument. Everything else follows from it, as on the command line: the same code, the same numbers to the last
bit, the same messages.

Units are those of the names, as in the files: ``_deg``, ``_mm``, ``_m``, ``_n``, ``_nm``, ``_rad_per_nm``; slides are in
millimetres where hinges are in degrees.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from ._load import preload

preload()

from ._elastocal import COMMIT, VERSION, set_shared  # noqa: E402

if TYPE_CHECKING:
    from ._commands import OPTIONS_OF_THE_PROGRAM_ALONE, command
    from ._data import Experiment, Measurements, Plan, Readings
    from ._errors import ElastocalError, UsageError
    from ._problem import Problem
    from ._progress import show_progress
    from ._results import Assessment, Compensation, Condition, Design, Identified, Results, Validation
    from ._scenario import Scenario, compare, explain, import_table, init, merge, schema
    from ._tables import read_table

#: Where the shipped `scenarios` and `models` are: those of the package, or of the clone that it is used in.
SHARED = next(
    (folder for folder in (Path(__file__).parent / "share", Path(__file__).parents[2]) if (folder / "scenarios").is_dir()),
    Path(__file__).parent / "share",
)
set_shared(str(SHARED))

__version__ = VERSION

__all__ = [
    "COMMIT",
    "OPTIONS_OF_THE_PROGRAM_ALONE",
    "VERSION",
    "Assessment",
    "Compensation",
    "Condition",
    "Design",
    "ElastocalError",
    "Experiment",
    "Identified",
    "Measurements",
    "Plan",
    "Problem",
    "Readings",
    "Results",
    "SHARED",
    "Scenario",
    "UsageError",
    "Validation",
    "__version__",
    "command",
    "compare",
    "explain",
    "import_table",
    "init",
    "merge",
    "read_table",
    "schema",
    "show_progress",
]


def __getattr__(name: str) -> object:
    """Names that need NumPy, when they are asked for: the command line, which starts here too, does without."""
    if name in __all__:
        for module in ("_commands", "_data", "_errors", "_problem", "_progress", "_results", "_scenario", "_tables"):
            found = import_module(f".{module}", __name__)
            if hasattr(found, name):
                return getattr(found, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
