"""The page about OPC UA matches the options, limits, severities and methods of the OPC UA server."""

import re
from pathlib import Path

from arcor2_hw.opcua import access, conditions, process, space
from arcor2_hw.plant import messages
from arcor2_server.cli.main import app
from arcor2_server.opcua import requests
from arcor2_server.packml import plc
from arcor2_server.plant import process as plant

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "opcua.md").read_text()


def test_the_page_states_the_limits_of_the_server() -> None:
    numbers = {
        r"at most (\d+) connections": access.MAX_CONNECTIONS,
        r"and (\d+) subscriptions": access.MAX_SUBSCRIPTIONS,
        r"text of at most (\d+) characters": requests.MAX_REQUEST_ID,
        r"The last (\d+) are stored": plc.MAX_PLANT_REQUESTS,
        r"does not answer for (\d+) s": messages.STALE_AFTER,
        r"later after up to (\d+) s": plant.MAX_PAUSE,
    }
    for pattern, number in numbers.items():
        (found,) = re.findall(pattern, PAGE)
        assert float(found) == number, pattern
    for priority, severity in conditions.SEVERITIES.items():
        assert f"{severity} {priority.value}" in PAGE
    assert space.URIS["own"] in PAGE
    assert process.PATH in PAGE
    assert f"after {plant.ALARM_AFTER} ends in a row" in PAGE


def test_the_options_exist() -> None:
    named = set(re.findall(r"--opcua[\w-]*", PAGE))
    help_text = " ".join(
        str(each.name) for command in ("serve", "demo") for each in app[command].assemble_argument_collection()
    )
    assert named
    assert [option for option in named if option not in help_text] == []
