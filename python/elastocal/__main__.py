"""The program: ``python -m elastocal``, and the command ``elastocal`` that is installed."""

import sys

from ._elastocal import main as program


def main() -> int:
    """Does what the command line says; signals are the program's."""
    return program(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
