"""The cell host's end of the socket."""

import socket

from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.link import Link


def test_messages_end_when_an_alive_sender_stops_sending() -> None:
    ours, theirs = socket.socketpair()
    wake, waker = socket.socketpair()
    with ours, theirs, wake, waker:
        link = Link(ours)
        theirs.sendall(m.encode(m.Alive(0.05)) + m.encode(m.StopProgram()))
        assert list(link.messages(wake)) == [m.StopProgram()]  # the socket is still open
        link.close(1.0)
        assert b"hangs" in theirs.recv(1000)
