"""The page about the fleet matches limits, variables and options, and the broker accepts its configurations."""

import re
import subprocess
from pathlib import Path

from arcor2_server.cli.main import app
from arcor2_server.fleet import collector, registry
from arcor2_server.settings import _VARIABLES
from tests.server.fleet.broker import USERS
from tests.server.nodes.conftest import NATS_SERVER

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "how-to" / "fleet.md").read_text()


def test_the_broker_accepts_the_configurations(tmp_path: Path) -> None:
    blocks = [block for _, block in re.findall(r"```(\w*)\n(.*?)```", PAGE, re.DOTALL) if "server_name" in block]
    assert len(blocks) == 2
    for block in blocks:
        file = tmp_path / "nats.conf"
        # The certificates of the page do not exist here.
        file.write_text(re.sub(r"tls \{.*\}", "", block).replace("/var/lib/nats", str(tmp_path)))
        subprocess.run([NATS_SERVER, "-t", "-c", str(file)], check=True, capture_output=True)


def test_the_tests_use_the_permissions_of_the_page() -> None:
    def permissions(text: str) -> list[str]:
        return re.findall(r"permissions: (\{.*?\}) ", text)

    assert permissions(PAGE)[:2] == permissions(USERS)


def test_the_page_states_the_limits_variables_and_options() -> None:
    assert f"no state for {registry.SILENT_AFTER:g} s" in PAGE
    assert f"up to {collector.ACKNOWLEDGE_TIMEOUT:g} s later" in PAGE
    named = set(re.findall(r"ARCOR2_HW_\w+", PAGE))
    assert named - set(_VARIABLES) == set()
    for command in ("serve", "broker", "accept", "pair"):
        options = set(re.findall(r"--[a-z]+", " ".join(re.findall(rf"arcor2-hw fleet {command}\b([^`\n]*)", PAGE))))
        help_text = " ".join(str(each.name) for each in app["fleet"][command].assemble_argument_collection())
        assert options, command
        assert [option for option in options if option not in help_text] == [], command
