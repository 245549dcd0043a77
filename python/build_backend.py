"""Builds with maturin, without MuJoCo: its library is pip's, and is there before the extension is loaded (`_load.py`).

A wheel has the shipped scenarios and models in it (`elastocal/share`).
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import maturin

get_requires_for_build_wheel = maturin.get_requires_for_build_wheel
get_requires_for_build_sdist = maturin.get_requires_for_build_sdist
get_requires_for_build_editable = maturin.get_requires_for_build_editable
prepare_metadata_for_build_wheel = maturin.prepare_metadata_for_build_wheel
prepare_metadata_for_build_editable = maturin.prepare_metadata_for_build_editable
build_sdist = maturin.build_sdist


#: An archive of nothing: what the linker takes for MuJoCo's library. Its functions are found when the extension is loaded.
_NOTHING = b"!<arch>\n"


def _linked(build, *arguments, **options):
    """Builds with a folder in which the linker finds a libmujoco.so."""
    if os.environ.get("MUJOCO_DYNAMIC_LINK_DIR"):
        return build(*arguments, **options)
    # The same name in every build: another one would compile what links against it anew.
    folder = Path(tempfile.gettempdir()) / f"elastocal-mujoco-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    library = folder / "libmujoco.so"
    library.unlink(missing_ok=True)
    library.write_bytes(_NOTHING)
    os.environ["MUJOCO_DYNAMIC_LINK_DIR"] = str(folder)
    return build(*arguments, **options)


def build_wheel(*arguments, **options):
    here = Path(__file__).resolve().parent
    share = here / "elastocal/share"
    subprocess.run([sys.executable, here.parent / "tools/shared.py", share], check=True)
    try:
        return _linked(maturin.build_wheel, *arguments, **options)
    finally:
        shutil.rmtree(share)


def build_editable(*arguments, **options):
    return _linked(maturin.build_editable, *arguments, **options)
