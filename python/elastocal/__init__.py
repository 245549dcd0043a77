"""Plans of calibration experiments for the joint stiffness of robots.

A :class:`Scenario` is what a robot's calibration is about: the model, what must be accurate and where, the loads and
the instrument. Everything else follows from it, as on the command line: the same code, the same numbers to the last
bit, the same messages.

Units are those of the names, as in the files: ``_deg``, ``_mm``, ``_m``, ``_n``, ``_nm``, ``_rad_per_nm``; slides are in
millimetres where hinges are in degrees.
"""

from __future__ import annotations

from ._data import (
    Assessment,
    Compensation,
    Design,
    ElastocalError,
    Identified,
    Measurements,
    Plan,
    Results,
    UsageError,
)
from ._load import preload

preload()

from ._commands import OPTIONS_OF_THE_PROGRAM_ALONE, command  # noqa: E402
from ._elastocal import COMMIT, VERSION  # noqa: E402
from ._scenario import Problem, Scenario, compare, import_table, init, merge, schema  # noqa: E402

__version__ = VERSION

__all__ = [
    "COMMIT",
    "OPTIONS_OF_THE_PROGRAM_ALONE",
    "VERSION",
    "Assessment",
    "Compensation",
    "Design",
    "ElastocalError",
    "Identified",
    "Measurements",
    "Plan",
    "Problem",
    "Results",
    "Scenario",
    "UsageError",
    "command",
    "compare",
    "import_table",
    "init",
    "merge",
    "schema",
]
