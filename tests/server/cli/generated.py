"""Run the tests of a generated driver."""

import os
from pathlib import Path

from tests import commands


def run_tests(root: Path, *arguments: str) -> str:
    """Run the tests in a separate process. They must pass; return the output.

    Only the pytest plugin of ARCOR2-HW is loaded, because loading the other plugins takes several seconds.
    """
    options = ("-q", "-p", "arcor2_hw.testing.plugin", "-p", "no:cacheprovider", "-rs")
    environment = os.environ | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    done = commands.run(commands.PYTEST, *options, *arguments, cwd=root, env=environment, timeout=200)
    assert done.returncode == 0, done.stdout[-6000:]
    return done.stdout
