"""What Tab offers in a notebook: asked of a live kernel, as Jupyter asks it."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator

import pytest
from jupyter_client.manager import start_new_kernel

import elastocal as ec
from elastocal._commands import keywords, options

from test_elastocal import QUICK, ROOT

Completed = Callable[[str], set[str]]


@pytest.fixture(scope="module")
def completed() -> Iterator[Completed]:
    """What completes a line."""
    manager, client = start_new_kernel(kernel_name="python3")
    try:
        reply = client.execute_interactive(f"import elastocal as ec; scenario = ec.Scenario.load({str(QUICK)!r})", timeout=120)
        assert reply["content"]["status"] == "ok", reply["content"]
        yield lambda line: set(client.complete(line, reply=True, timeout=120)["content"]["matches"])
    finally:
        client.stop_channels()
        manager.shutdown_kernel(now=True)


@pytest.mark.parametrize(
    ("name", "command"),
    [("design", "plan"), *((name, name) for name in options() if hasattr(ec.Scenario, name))],
)
def test_all_keywords_complete(completed: Completed, name: str, command: str) -> None:
    wanted = {each for each in keywords(command) if each in inspect.signature(getattr(ec.Scenario, name)).parameters}
    assert wanted and {f"{each}=" for each in wanted} <= completed(f"scenario.{name}(")


def test_names_complete(completed: Completed) -> None:
    assert completed("scenario.design(exp") == {"experiments="}
    assert {"no_proof=", "noise_only="} <= completed("scenario.design(4, no")
    assert {"plans=", "executor=", "shards=", "tallies="} <= completed("scenario.study(")
    assert {"columns=", "rotation=", "units="} <= completed("ec.read_table(frame, ")
    assert {"unit=", "wrench="} <= completed("ec.Plan(q, ")
    assert {"violations", "objective", "ranges_deg"} <= completed("scenario.problem.")
    assert {each for each in ec.__all__ if each[0] != "_"} <= completed("ec.")


def test_the_page_shows_what_completes(completed: Completed) -> None:
    page = (ROOT / "docs/python.md").read_text(encoding="utf-8")
    shown = re.findall(r"^(.+)<Tab> +(.+)$", page, flags=re.MULTILINE)
    assert len(shown) > 3
    for line, names in shown:
        assert set(names.split()) <= completed(line), line
