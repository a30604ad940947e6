"""Requests on a line to a device."""

import socket
import time

import pytest

from arcor2_hw.objects.line import Line


def test_an_answer_that_arrives_while_the_process_is_suspended_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        line = Line("scale", f"socket://127.0.0.1:{server.getsockname()[1]}", answer_timeout=0.1)
        line.open(10.0)
        device, _ = server.accept()
        receive = line.receive

        def suspend() -> bytes:
            monkeypatch.setattr(line, "receive", receive)
            device.sendall(b"S S 1 kg\r")
            time.sleep(2 * line.answer_timeout)
            return b""

        monkeypatch.setattr(line, "receive", suspend)
        with device:
            assert line.ask_text("SI") == "S S 1 kg"
        line.close()
