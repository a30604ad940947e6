"""What all tests share."""

from pathlib import Path
from typing import Any

import pytest

pytest_plugins = ["pytester", "tests.leaks"]


@pytest.fixture(scope="session")
def spec() -> Path:
    """The stated protocol, beside the checkout."""
    path = Path(__file__).resolve().parents[2] / "shared" / "spec"
    assert path.is_dir(), f"the protocol is expected in {path}"
    return path


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Keep in one process what shares a fake: a module, or the suite's cases on one bench.

    By the ids of the tests: the marker xdist_group has no effect with pytest 9.2 and xdist 3.8.
    """
    if config.getvalue("dist") != "loadgroup":
        return None
    from xdist.scheduler import LoadScopeScheduling

    class TogetherOnOneFake(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file, _, rest = nodeid.partition("::")
            bench = rest.rpartition("[")[2] if rest.startswith("TestConformance::") else ""
            return f"{file}:{bench}"

    return TogetherOnOneFake(config, log)
