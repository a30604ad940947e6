"""Searching for devices to which a type could connect; the bus belongs to a fake drive in its own process."""

import json
from typing import Any

import pytest

from arcor2_hw.data.object_type import ParameterMeta
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import InvalidData
from arcor2_server.errors import RequestRefused
from tests.fakes.conftest import FakeProcess

from .conftest import Server, serving

SETTINGS = [
    ParameterMeta("channel", "string", found_by="serial"),
    ParameterMeta("interface", "string_enum", default_value='"slcan"'),
    ParameterMeta("bitrate", "integer", default_value="500000"),
    ParameterMeta("node_id", "integer", default_value="5", found_by="can"),
]


def _search(channel: object, **settings: object) -> dict[str, Any]:
    values = {"channel": channel} | settings
    parameters = [{"name": name, "type": "string", "value": json.dumps(value)} for name, value in values.items()]
    return {"type": "Belt", "setting": "node_id", "parameters": parameters}


@serving()
async def test_nodes_of_a_can_bus_are_offered_as_values_of_the_setting(server: Server) -> None:
    server.types.settings["Belt"] = SETTINGS
    belt = FakeProcess("conveyor", "--node", "17")
    try:
        belt.control.do("heal")
        (found,) = await server.ask("FindDevices", _search(f"socket://{belt.ready['can']}"))
        assert found.value == "17"
        assert "profile 402" in found.description
        assert found.serial
        by_name = _search(f"socket://{belt.ready['socketcand']}/can0", interface="socketcand")
        assert [each.value for each in await server.ask("FindDevices", by_name)] == ["17"]
    finally:
        belt.end()


@serving()
async def test_devices_at_entered_addresses_are_offered_as_values_of_the_setting(server: Server) -> None:
    server.types.settings["Tester"] = [
        ParameterMeta("host", "string", found_by="modbus"),
        ParameterMeta("port", "integer", default_value="502"),
    ]
    tester = FakeProcess("functional_tester")
    try:
        host, _, port = tester.ready["modbus"].rpartition(":")
        args = {"type": "Tester", "setting": "host", "parameters": [{"name": "port", "type": "integer", "value": port}]}
        (found,) = await server.ask("FindDevices", args | {"addresses": f"{host}, 127.0.0.8/30"})
        assert json.loads(found.value) == found.address == host
        assert found.description
        with pytest.raises(InvalidData, match="Enter the addresses"):  # nothing is searched by itself
            await server.ask("FindDevices", args)
    finally:
        tester.end()


@serving()
async def test_a_search_that_cannot_work_states_the_reason(server: Server) -> None:
    server.types.settings["Belt"] = SETTINGS
    with pytest.raises(InvalidData, match="No search finds the setting bitrate of Belt"):
        await server.ask("FindDevices", {"type": "Belt", "setting": "bitrate"})
    with pytest.raises(InvalidData, match="needs the settings interface, channel, bitrate"):
        await server.ask("FindDevices", {"type": "Belt", "setting": "node_id"})
    with pytest.raises(InvalidData, match="wrong type"):
        await server.ask("FindDevices", _search(["/dev/ttyUSB0"]))
    with pytest.raises(RequestRefused, match="cannot be opened") as refused:
        await server.ask("FindDevices", _search("/dev/missing"))
    assert refused.value.message.key == "{named} cannot be opened: {reason}", "the message can be translated"
    with pytest.raises(RequestRefused, match="channel must be"):  # this adapter of pyserial would write a file
        await server.ask("FindDevices", _search("spy:///dev/null?file=/tmp/x"))
    await server.open(Scene("scene", id="scn_1"))
    await server.start()
    with pytest.raises(RequestRefused, match="online"):
        await server.ask("FindDevices", _search("/dev/missing"))
