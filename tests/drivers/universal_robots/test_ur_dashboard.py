"""Dashboard connection: deadlines, late answers, idle connections that broke."""

import socket
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from arcor2_drivers.universal_robots.dashboard import Dashboard
from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, NotConnected, Refused

GREETING = b"Connected: Universal Robots Dashboard Server\n"
Answer = Callable[[socket.socket, bytes], None]


@pytest.fixture
def server() -> Iterator[Callable[[Answer], Dashboard]]:
    """Return ``server(answer)``: a client of a dashboard server that handles each line with that function."""
    made: list[tuple[socket.socket, Dashboard, threading.Thread]] = []

    def serve(listening: socket.socket, answer: Answer) -> None:
        while True:
            try:
                client, _ = listening.accept()
            except OSError:
                return
            with client, client.makefile("rb") as lines:
                try:
                    client.sendall(GREETING)
                    for line in lines:
                        answer(client, line.strip())
                except OSError:
                    continue

    def start(answer: Answer) -> Dashboard:
        listening = socket.create_server(("127.0.0.1", 0))
        thread = threading.Thread(target=serve, args=(listening, answer))
        thread.start()
        dashboard = Dashboard(*listening.getsockname())
        made.append((listening, dashboard, thread))
        return dashboard

    yield start
    for listening, dashboard, thread in made:
        dashboard.close()
        listening.shutdown(socket.SHUT_RDWR)
        listening.close()
        thread.join(30.0)


def test_a_late_answer_is_not_used_for_a_later_request(server: Callable[[Answer], Dashboard]) -> None:
    def answer(client: socket.socket, line: bytes) -> None:
        if line == b"slow":
            time.sleep(0.3)
        client.sendall(b"answer to " + line + b"\n")

    dashboard = server(answer)
    assert dashboard.ask("first") == "answer to first"
    with pytest.raises(DeviceTimeout, match=dashboard.address) as timeout:
        dashboard.ask("slow", 0.1)
    assert timeout.value.detail == "slow"
    time.sleep(0.3)
    assert dashboard.ask("next") == "answer to next"


def test_unsolicited_data_is_not_used_as_an_answer(server: Callable[[Answer], Dashboard]) -> None:
    dashboard = server(lambda client, line: client.sendall(line + b"\nand one more\n"))
    assert dashboard.ask("first") == "first"
    time.sleep(0.05)
    assert dashboard.ask("second") == "second"


def test_an_idle_connection_that_was_closed_is_replaced(server: Callable[[Answer], Dashboard]) -> None:
    def answer(client: socket.socket, line: bytes) -> None:
        client.sendall(line + b"\n")
        client.shutdown(socket.SHUT_RDWR)

    dashboard = server(answer)
    assert dashboard.ask("first") == "first"
    time.sleep(0.05)
    assert dashboard.ask("second") == "second"


def test_errors_are_typed_and_name_the_address(server: Callable[[Answer], Dashboard]) -> None:
    def answer(client: socket.socket, line: bytes) -> None:
        if line == b"flood":
            client.sendall(b"x" * 20000)
        elif line == b"close":
            client.shutdown(socket.SHUT_RDWR)
        else:
            client.sendall(b"No\n")

    dashboard = server(answer)
    for command in ("flood", "close"):
        with pytest.raises(ConnectionLost, match=dashboard.address):
            dashboard.ask(command)
    with pytest.raises(Refused, match="'play': No"):
        dashboard.do("play", "Starting program")
    with pytest.raises(NotConnected, match=r"127\.0\.0\.1:1\.$"):
        Dashboard("127.0.0.1", 1).ask("x")
