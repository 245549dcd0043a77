"""Absolute readings out of a data frame."""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from . import _elastocal
from ._commands import command, read
from ._data import Readings, Unit, angles, numbers
from ._errors import ElastocalError, UsageError, nearest

if TYPE_CHECKING:
    import pandas as pd
    from scipy.spatial.transform import Rotation

#: Columns with numbers, and the unit that they have if `units` says nothing.
UNITS = {"joints": "deg", "position": "mm", "rotation": "deg", "force": "N", "torque": "Nm", "time": "s", "temperature": "C"}
#: Columns with words; what is not a column's name is the word of all rows.
WORDS = ["target", "station", "visit", "approach"]
#: SciPy's words for rotations, and elastocal's.
CONVENTIONS = {"quat": "quaternion wxyz", "matrix": "quaternion wxyz", "rotvec": "rotation_vector"}


def convention(rotation: str) -> str:
    """Elastocal's words for SciPy's: capital axes turn with the target, small ones stand still (the same angles in reverse)."""
    if rotation in CONVENTIONS:
        return CONVENTIONS[rotation]
    if re.fullmatch(r"[xyz]{3}|[XYZ]{3}", rotation):
        return f"intrinsic {rotation.lower() if rotation.isupper() else rotation[::-1]}"
    wanted = "'XYZ' (axes that turn with the target), 'xyz' (axes that stand still), 'quat' (x, y, z, w), 'rotvec' or 'matrix'"
    raise UsageError(f"rotation is not {rotation!r}; as in SciPy it is {wanted}")


def read_table(
    frame: pd.DataFrame,
    *,
    columns: Mapping[str, str | Sequence[str]],
    rotation: str | Rotation | None = None,
    units: Mapping[str, str | Sequence[str]] | None = None,
) -> Readings:
    """Absolute readings out of a data frame of pandas.

    ``columns`` says where things are: ``joints`` in the model's order, ``position`` and ``rotation`` of the target in the
    instrument's frame, with standard deviations ``position_std`` and ``rotation_std``; the load as ``force`` and ``torque``;
    ``time``, ``temperature``; ``target``, ``station``, ``visit``, ``approach``: a column, or one word for all rows.

    ``rotation`` is SciPy's word for the columns: ``"XYZ"`` (intrinsic Euler angles), ``"xyz"`` (extrinsic), ``"quat"``, ``"rotvec"``,
    ``"matrix"``; or a SciPy ``Rotation`` with one for each row. ``units`` are deg, mm, N, N m, s and C if not given:
    ``units={"joints": "rad"}``. Joints of several kinds have a list of as many, slides with a length: ``{"joints": ["mm", "deg"]}``.
    """
    if not hasattr(frame, "to_csv"):
        raise UsageError(f"a data frame of pandas is wanted, not {type(frame).__name__}", "pandas.read_csv(path) makes one of a file")
    made = frame.copy()
    known = {*UNITS, *WORDS, "position_std", "rotation_std"}
    places: dict[str, Any] = {key: [value] if isinstance(value, str) else list(value) for key, value in columns.items()}
    unit: dict[str, Any] = UNITS | dict(units or {})
    for what in [*places, *unit]:
        if what not in known:
            raise UsageError(f"columns have no {what!r}; they have: {', '.join(sorted(known))}", nearest(what, known))
    if rotation == "matrix" and "rotation" in places:
        rotation = _rotations(made, places["rotation"])
    if rotation is not None and not isinstance(rotation, str):
        turned = rotation.as_quat()
        if len(turned) != len(made):
            raise UsageError(f"rotation has {len(turned)} rotations, and the frame has {len(made)} rows")
        places["rotation"] = ["qx of rotation", "qy of rotation", "qz of rotation", "qw of rotation"]
        made[places["rotation"]] = turned
    for what in ("joints", "position"):
        if what not in places:
            raise UsageError(f"columns have no {what!r}", "columns={'joints': [...], 'position': ['x', 'y', 'z']} are needed")
    if "rotation" in places and rotation is None:
        raise UsageError("columns have a rotation: rotation='XYZ' or another of SciPy's words says how it is written")
    if "rotation" not in places and (rotation is not None or "rotation_std" in places):
        raise UsageError("columns have no 'rotation'", "columns={'rotation': [...]} says where the rotations are")
    for what, names in places.items():
        for name in names if what not in WORDS else []:
            if name not in made:
                raise UsageError(f"columns[{what!r}]: the frame has no column {name!r}", nearest(name, map(str, made.columns)))
        if what not in WORDS:
            numbers(f"columns[{what!r}]", made[names].to_numpy())
    if isinstance(unit["joints"], str):
        unit["joints"] = [unit["joints"]] * len(places["joints"])
    if len(unit["joints"]) != len(places["joints"]):
        raise UsageError(f"units['joints'] has {len(unit['joints'])} units, and columns['joints'] has {len(places['joints'])} joints")
    for each in (kind for kind in get_args(Unit) if kind in unit["joints"]):
        turning = [name for name, its in zip(places["joints"], unit["joints"], strict=True) if its == each]
        try:
            angles(made[turning].to_numpy(), each if "joints" in (units or {}) else None)
        except UsageError as error:
            hint = "units={'joints': 'rad'} or {'joints': 'deg'} says what they are"
            raise UsageError(str(error).replace("q_deg", "columns['joints']"), hint) from None
    mapping = _mapping(places, unit, rotation, {str(name) for name in made.columns})
    with tempfile.TemporaryDirectory(prefix="elastocal-") as name:
        folder = Path(name)
        made.to_csv(folder / "table.csv", index=False)
        (folder / "mapping.toml").write_text(_elastocal.written_toml(json.dumps(mapping)), encoding="utf-8")
        out = folder / "measurements.csv"
        try:
            command("import", folder / "table.csv", mapping=folder / "mapping.toml", measurements_out=out)
        except ElastocalError as error:
            # Nobody has written these files.
            told = re.sub(rf"{re.escape(name)}/\S+: |(?<=\w) \(line \d+\)", "", str(error))
            raise type(error)(told, error.hint and error.hint.replace(" in the mapping", ""), error.code) from None
        return Readings(read(out))


def _rotations(frame: pd.DataFrame, names: list[str]) -> Rotation:
    """Rotations of matrices, row by row."""
    from scipy.spatial.transform import Rotation as Turn

    for name in names:
        if name not in frame:
            raise UsageError(f"columns['rotation']: the frame has no column {name!r}", nearest(name, map(str, frame.columns)))
    if len(names) != 9:
        raise UsageError(f"columns['rotation'] has {len(names)} names; a matrix has 9, row by row")
    return Turn.from_matrix(frame[names].to_numpy(dtype=float).reshape(-1, 3, 3))


def _mapping(places: dict[str, Any], unit: dict[str, Any], rotation: Any, there: set[str]) -> dict[str, Any]:
    """What the columns are, as `import` takes it."""
    is_quaternion = not isinstance(rotation, str) or rotation == "quat"

    def in_order(names: list[str]) -> list[str]:
        """Quaternions with the real part first; angles about axes that stand still in reverse."""
        if is_quaternion:
            return [*names[3:], *names[:3]]
        return names[::-1] if rotation.islower() and rotation not in CONVENTIONS else names

    said: dict[str, Any] = {"joint": [{"column": each, "unit": its} for each, its in zip(places["joints"], unit["joints"], strict=True)]}
    for what in ("position", "rotation", "force", "torque"):
        if what in places:
            said[what] = {"columns": in_order(places[what]) if what == "rotation" else places[what]}
            if what != "rotation" or not is_quaternion:
                said[what]["unit"] = unit[what]
            if f"{what}_std" in places:
                stds = places[f"{what}_std"]
                said[what]["std_columns"] = in_order(stds) if what == "rotation" else stds
    if "rotation" in places:
        said["rotation"]["convention"] = CONVENTIONS["quat"] if is_quaternion else convention(rotation)
    for what in ("time", "temperature"):
        if what in places:
            said[what] = {"column": places[what][0], "unit": unit[what]}
    for what in WORDS:
        if what in places:
            said[what] = {"column" if places[what][0] in there else "value": places[what][0]}
    return said
