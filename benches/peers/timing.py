"""Times both sides in turn, so that a noisy machine hits both."""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass
class Result:
    """A row of the table."""

    name: str
    peer: str
    ours_s: list[float] = field(default_factory=list)
    peer_s: list[float] = field(default_factory=list)
    at_least: bool = False  # the peer was stopped: its time is a lower bound
    note: str = ""
    skipped: str = ""

    def ratios(self) -> list[float]:
        return [peer / ours for ours, peer in zip(self.ours_s, self.peer_s)]


def spread(values: list[float]) -> dict[str, float]:
    return {"median": statistics.median(values), "min": min(values), "max": max(values)}


Timer = Callable[[int], float]


def timer(work: Callable[[int], object]) -> Timer:
    def seconds(times: int) -> float:
        start = time.perf_counter()
        work(times)
        return time.perf_counter() - start

    return seconds


def fitting(side: Timer, slice_s: float) -> int:
    """How many repetitions take about so long; warms up on the way."""
    side(1)
    times = 1
    while (elapsed := side(times)) < slice_s / 4:
        times = max(2 * times, int(times * slice_s / 2 / max(elapsed, 1e-9)))
    return max(1, round(times * slice_s / elapsed))


def alternate(sides: list[Timer], slice_s: float, repetitions: int) -> list[list[float]]:
    """Seconds for one repetition of each side, A B A B."""
    counts = [fitting(side, slice_s) for side in sides]
    rounds = [[side(count) / count for side, count in zip(sides, counts)] for _ in range(repetitions)]
    return [list(side) for side in zip(*rounds)]
