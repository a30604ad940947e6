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
