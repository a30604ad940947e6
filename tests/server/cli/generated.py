"""Run the tests of a generated driver."""

import os
import subprocess
import sys
from pathlib import Path


def run_tests(root: Path, *arguments: str) -> str:
    """Run the tests in a separate process. They must pass; return the output.

    Only the pytest plugin of ARCOR2-HW is loaded, because loading the other plugins takes several seconds.
    """
    command = [sys.executable, "-m", "pytest", "-q", "-p", "arcor2_hw.testing.plugin", "-p", "no:cacheprovider", "-rs"]
    environment = os.environ | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    done = subprocess.run(
        [*command, *arguments], cwd=root, env=environment, capture_output=True, text=True, timeout=200, check=False
    )
    assert done.returncode == 0, done.stdout[-6000:]
    return done.stdout
