"""Builds with maturin, linked against the MuJoCo library of the pip package that is a requirement of the build."""

import importlib.util
import os
import tempfile
from pathlib import Path

import maturin

get_requires_for_build_wheel = maturin.get_requires_for_build_wheel
get_requires_for_build_sdist = maturin.get_requires_for_build_sdist
get_requires_for_build_editable = maturin.get_requires_for_build_editable
prepare_metadata_for_build_wheel = maturin.prepare_metadata_for_build_wheel
prepare_metadata_for_build_editable = maturin.prepare_metadata_for_build_editable
build_sdist = maturin.build_sdist


def _linked(build, *arguments, **options):
    """Builds with a folder in which the linker finds libmujoco.so."""
    if os.environ.get("MUJOCO_DYNAMIC_LINK_DIR"):
        return build(*arguments, **options)
    spec = importlib.util.find_spec("mujoco")
    if spec is None or not spec.submodule_search_locations:
        raise RuntimeError("pip's mujoco is not there; it is a requirement of the build")
    library = next(Path(spec.submodule_search_locations[0]).glob("libmujoco.so.*"))
    # The same name in every build: another one would compile what links against it anew.
    folder = Path(tempfile.gettempdir()) / f"elastocal-mujoco-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    for name in (library.name, "libmujoco.so"):
        link = folder / name
        link.unlink(missing_ok=True)
        link.symlink_to(library)
    os.environ["MUJOCO_DYNAMIC_LINK_DIR"] = str(folder)
    return build(*arguments, **options)


def build_wheel(*arguments, **options):
    return _linked(maturin.build_wheel, *arguments, **options)


def build_editable(*arguments, **options):
    return _linked(maturin.build_editable, *arguments, **options)
