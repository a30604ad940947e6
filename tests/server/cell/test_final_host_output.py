"""The last output of a host is read, even if a busy server reads it late."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.ring import Ring
from arcor2_server.hosts import process as host_module
from arcor2_server.hosts.process import CellHost, _Connection


class Listener:
    def __init__(self) -> None:
        self.texts: list[str] = []

    def host_message(self, host: CellHost, message: Any) -> None:
        self.texts.append(message.text)

    def host_silent(self, host: CellHost, silent: bool) -> None:
        raise AssertionError

    def host_ended(self, host: CellHost, reason: Message) -> None:
        self.texts.append(reason.text)


@pytest.mark.parametrize("closes", [True, False])
async def test_all_output_of_a_host_is_read_before_its_end_is_reported(
    monkeypatch: pytest.MonkeyPatch, closes: bool
) -> None:
    monkeypatch.setattr(host_module, "LATE_TIMEOUT", 2.0)

    async def wait() -> int:
        return 0

    process: Any = SimpleNamespace(pid=1, returncode=0, wait=wait, kill=lambda: None)
    wire, listener = _Connection(), Listener()
    wire.host = host = CellHost(process, wire, Ring())
    host.user = listener
    watching = asyncio.create_task(host._watch_end())
    for n in range(4):
        await asyncio.sleep(0.7)
        wire.data_received(m.encode(m.LogLine("info", str(n))))
    if closes:
        wire.connection_lost(None)
    # The end is also reported if another process keeps the socket open.
    await asyncio.wait_for(watching, 30)
    assert listener.texts == ["0", "1", "2", "3", "the cell host ended"]
