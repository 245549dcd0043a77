"""What is being done, as progress bars where tqdm is there and somebody looks."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

#: Takes the name of what is done, how much of it is done, of how much (None if that is not known), and a message.
Listener = Callable[[str, int, int | None, str], object]

_chosen: bool | Listener | None = None


def show_progress(how: bool | Listener | None = None) -> None:
    """Shows progress with tqdm (``True``), not at all (``False``), or by a function; ``None``: with tqdm, if it is there, on a
    terminal and in notebooks.

    The function takes the name of what is done, how much of it is done, of how much (or None), and a message.
    """
    global _chosen
    if how is True and importlib.util.find_spec("tqdm") is None:
        raise ImportError("progress bars need tqdm: pip install 'elastocal[notebook]'")
    _chosen = how


class Bars:
    """A bar of tqdm for each thing that is done."""

    def __init__(self) -> None:
        self._bar: Any = None
        self._what = ""

    def __call__(self, what: str, done: int, total: int | None, message: str) -> None:
        from tqdm.auto import tqdm

        if not what:
            return
        if self._bar is None or what != self._what:
            self.close()
            self._bar, self._what = tqdm(desc=what, total=total, leave=False, bar_format="{desc}"), what
        # How much there is may be known later than what is done.
        self._bar.bar_format = "{desc} {bar:30} {n_fmt}/{total_fmt} {elapsed}{postfix}" if total else "{desc} {elapsed}{postfix}"
        self._bar.n, self._bar.total = done, total
        self._bar.set_postfix_str(message, refresh=False)
        self._bar.refresh()

    def close(self) -> None:
        """Takes the bar away."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def _is_notebook() -> bool:
    """Whether this runs in a kernel, and not only beside its package."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and hasattr(ipython.get_ipython(), "kernel")


@contextmanager
def progress() -> Iterator[Listener | None]:
    """Who is told of progress, if anybody."""
    if callable(_chosen):
        yield _chosen
        return
    is_seen = sys.stderr is not None and sys.stderr.isatty() or _is_notebook()
    is_wanted = is_seen if _chosen is None else _chosen
    if not is_wanted or importlib.util.find_spec("tqdm") is None:
        yield None
        return
    bars = Bars()
    try:
        yield bars
    finally:
        bars.close()
