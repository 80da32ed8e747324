"""The suite on two cores: one thread a process, the longest files first, what shares fixtures stays together.

``pytest -n 2`` does so; without ``-n`` everything runs in one process, in the same order.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from typing import Any

import pytest

for _threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")  # before numpy is loaded here, in workers and in commands

from shapes import check_shapes  # noqa: E402

check_shapes()  # before labsim is imported

# begun first, so that no worker is left alone with one of them at the end
LONGEST = (
    "tests/diagnosis/test_campaign.py",
    "tests/cli/test_demo.py",
    "tests/notebooks/",
    "tests/report/",
    "tests/video/test_tracker.py",
    "tests/faults/test_mutants.py",
    "tests/faults/",
)
TOGETHER = ("tests/report/",)  # folders whose files share fixtures of the session


@pytest.fixture(scope="session")
def shared_store() -> str:
    """The user's own store (LABSIM_STORE names another): a run is the same whoever asks, so no test makes one that the demo,
    a notebook or the last session has made. Tests of the store itself have stores of their own."""
    from labsim.runs.store import default_store

    return str(default_store())


@pytest.fixture(scope="module")
def browser():
    """Headless Chromium of the system, driven by Playwright; the test is skipped where either is missing."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    named = os.environ.get("LABSIM_CHROMIUM")
    chromium = (
        named or shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    )
    if chromium is None:
        pytest.skip("no Chromium here (Debian: apt install chromium; or name it in LABSIM_CHROMIUM)")
    with playwright.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture
def record_property(record_property: Callable[[str, object], None]) -> Callable[[str, object], None]:
    """As text, which is what the file gets: a worker cannot send numpy's numbers to the process that writes it."""
    return lambda name, value: record_property(name, str(value))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    def rank(item: pytest.Item) -> int:
        return next((k for k, part in enumerate(LONGEST) if item.nodeid.startswith(part)), len(LONGEST))

    items.sort(key=rank)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Each file (each folder of TOGETHER) to one worker, in the order above."""
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            folder = next((part for part in TOGETHER if nodeid.startswith(part)), None)
            return folder or nodeid.partition("::")[0]

    config.option.loadscopereorder = False
    return ByFile(config, log)
