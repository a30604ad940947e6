"""What all tests share."""

from pathlib import Path

import pytest

pytest_plugins = ["pytester", "tests.leaks"]


@pytest.fixture(scope="session")
def spec() -> Path:
    """The stated protocol, beside the checkout."""
    path = Path(__file__).resolve().parents[2] / "shared" / "spec"
    assert path.is_dir(), f"the protocol is expected in {path}"
    return path


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep in one process what shares a fake: a module, or the suite's cases on one bench.

    First of all, since xdist reads the groups in a hook of the same name.
    """
    for item in items:
        callspec = getattr(item, "callspec", None)
        bench = callspec.params.get("arcor2_running_bench") if callspec is not None else None
        file = item.nodeid.partition("::")[0]  # not `location`: a case lies in the file of its own class
        item.add_marker(pytest.mark.xdist_group(f"{file}:{bench.type_name() if bench else ''}"))
