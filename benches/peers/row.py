"""What a peer offers: work that elastocal's driver does too."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass
class Row:
    """The peer's side of one row of the table."""

    name: str  # what both do
    path: str  # elastocal's hot path, in benches/driver/paths.rs
    peer: str
    work: Callable[[int], object]  # does the same so many times


def repeat(work: Callable[[], object]) -> Callable[[int], None]:
    def times(count: int) -> None:
        for _ in range(count):
            work()

    return times


def check(what: str, found, expected, tolerance: float) -> None:
    """Both sides came to the same numbers, relative to the largest of them."""
    found, expected = np.asarray(found), np.asarray(expected)
    apart = np.abs(found - expected).max() / np.abs(expected).max()
    assert apart < tolerance, f"{what}: the peer's numbers differ by {apart:.1e}"
