"""The fake as a process and on the wire, with plain sockets: cases that no client library can produce."""

import json
import signal
import socket
import struct
import subprocess
import sys
from itertools import pairwise

import psutil
import pytest

from arcor2_fakes.control import BlockingControlClient, ControlError, parse_address
from tests.fakes.conftest import run_fake
from tests.waiting import wait_for


class RtdeSocket:
    """A minimal RTDE client with its own framing."""

    def __init__(self, fake):
        self.socket = socket.create_connection(parse_address(fake.ready["rtde"]), 2.0)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def send(self, kind, payload=b""):
        self.socket.sendall(struct.pack(">Hc", len(payload) + 3, kind) + payload)

    def read(self, size):
        data = b""
        while len(data) < size:
            more = self.socket.recv(size - len(data))
            if not more:
                raise EOFError
            data += more
        return data

    def frame(self):
        size, kind = struct.unpack(">Hc", self.read(3))
        return kind, self.read(size - 3)

    def ask(self, kind, payload=b""):
        self.send(kind, payload)
        answer, data = self.frame()
        assert answer == kind
        return data

    def outputs(self, names, frequency=500.0):
        return self.ask(b"O", struct.pack(">d", frequency) + names)


def test_handshake_and_stream(ur):
    with RtdeSocket(ur) as rtde:
        assert rtde.ask(b"V", b"\x00\x01") == b"\x00"
        assert rtde.ask(b"V", b"\x00\x02") == b"\x01"
        assert struct.unpack(">4I", rtde.ask(b"v")) == (5, 25, 0, 0)
        assert rtde.ask(b"S") == b"\x00"  # nothing set up
        assert rtde.outputs(b"timestamp,joint_mode,actual_digital_output_bits,") == b"\x01DOUBLE,VECTOR6INT32,UINT64"
        assert rtde.ask(b"S") == b"\x01"  # the answer comes before the first package
        stamps = []
        for _ in range(50):
            kind, data = rtde.frame()
            assert kind == b"U"
            number, stamp, *modes, bits = struct.unpack(">Bd6iQ", data)
            assert (number, modes, bits) == (1, [253] * 6, 0)
            stamps.append(stamp)
        assert [b - a for a, b in pairwise(stamps)] == pytest.approx([0.002] * 49, abs=1e-9)
        rtde.send(b"P")
        while (frame := rtde.frame())[0] == b"U":
            pass
        assert frame == (b"P", b"\x01")
        rtde.socket.settimeout(0.05)
        with pytest.raises(TimeoutError):
            rtde.frame()


def test_lower_frequency_thins_the_stream(ur):
    with RtdeSocket(ur) as rtde:
        assert rtde.outputs(b"timestamp", 1000.0)[0] == 0
        assert rtde.outputs(b"timestamp", 125.0)[0] == 1
        rtde.ask(b"S")
        stamps = [struct.unpack(">Bd", rtde.frame()[1])[1] for _ in range(20)]
        assert [b - a for a, b in pairwise(stamps)] == pytest.approx([0.008] * 19, abs=1e-9)


def test_unknown_and_occupied_variables(ur):
    with RtdeSocket(ur) as first, RtdeSocket(ur) as second:
        assert first.outputs(b"timestamp,actual_coffee") == b"\x00DOUBLE,NOT_FOUND"
        assert first.ask(b"I", b"input_int_register_0,input_coffee") == b"\x00INT32,NOT_FOUND"
        assert first.ask(b"I", b"input_int_register_24,input_double_register_24") == b"\x01INT32,DOUBLE"
        assert first.ask(b"I", b"input_int_register_24") == b"\x02INT32"  # the variable is its own
        assert second.ask(b"I", b"input_int_register_24") == b"\x00IN_USE"
        ur.do("fieldbus", on=True)
        assert second.ask(b"I", b"input_int_register_0") == b"\x00IN_USE"
        ur.do("fieldbus", on=False)
        assert second.ask(b"I", b"input_int_register_0") == b"\x01INT32"
        ur.do("not_found", names=["actual_q"])
        assert second.outputs(b"actual_q") == b"\x00NOT_FOUND"
    with RtdeSocket(ur) as third:
        ur.control.wait_until(lambda t: t["rtde_clients"] == 1)
        assert third.ask(b"I", b"input_int_register_24") == b"\x01INT32"


def test_input_packages(ur):
    with RtdeSocket(ur) as rtde:
        rtde.ask(b"I", b"standard_digital_output_mask,standard_digital_output")
        rtde.send(b"U", b"\x01\x05\xff")
        assert ur.control.wait_until(lambda t: t["digital_outputs"])["digital_outputs"] == 5
        rtde.send(b"U", b"\x01\x01\x00and more than the recipe has")
        assert ur.control.wait_until(lambda t: t["digital_outputs"] != 5)["digital_outputs"] == 4
        for bad in (b"", b"\x01", b"\x09\x01\x01", b"\x00\xff\xff"):
            rtde.send(b"U", bad)
        rtde.ask(b"v")
        assert ur.do("truth")["digital_outputs"] == 4


@pytest.mark.parametrize(
    "junk", [b"\x00\x00U", b"\x00\x02V", b"\x00\x04V\x00", b"\x00\x06Oabc", b"\x00\x06I\xff\xfe\xfd"]
)
def test_garbage_closes_only_the_connection_of_its_client(ur, junk):
    with RtdeSocket(ur) as rtde:
        rtde.socket.sendall(junk)
        assert rtde.socket.recv(10) == b""
    with RtdeSocket(ur) as rtde:
        assert rtde.ask(b"V", b"\x00\x02") == b"\x01"


def test_dashboard_and_script_ports_accept_pieces_and_survive_garbage(ur):
    with socket.create_connection(parse_address(ur.ready["dashboard"]), 2.0) as client:
        lines = client.makefile()
        assert lines.readline().startswith("Connected")
        for piece in (b"robot", b"mode\nsafety", b"mode\n\xff\xfe\n"):
            client.sendall(piece)
        assert lines.readline() == "Robotmode: RUNNING\n"
        assert lines.readline() == "Safetymode: NORMAL\n"
        assert lines.readline().startswith("could not understand")
        client.sendall(b"quit\n")
        assert lines.readline() == "Disconnected\n"
        assert lines.readline() == ""
        lines.close()
    with socket.create_connection(parse_address(ur.ready["script"]), 2.0) as client:
        client.sendall(b"\x00\xff garbage\ndef broken(:\nset_standard_digital_out(2, True)\n")
        ur.control.wait_until(lambda t: t["digital_outputs"] == 4)


def test_truth_is_published_at_a_rate(ur):
    with socket.create_connection(parse_address(ur.ready["control"]), 2.0) as client:
        client.sendall(b'{"id":1,"do":"subscribe","to":"pose","rate":100}\n')
        lines = client.makefile()
        seen = [json.loads(lines.readline()) for _ in range(30)]
        lines.close()
    stamps = [m["data"]["t"] for m in seen if m.get("event") == "pose"]
    assert len(stamps) >= 29
    assert stamps[-1] - stamps[0] >= 0.7 * 0.01 * (len(stamps) - 1)


def test_invalid_control_commands_are_refused(ur):
    for command, arguments in [
        ("set_input", {"bit": 40}),
        ("guide", {"q": [0, 0, 0, 0, 0, 0]}),
        ("place", {"q": [0, 0, 0, 0, 0, 9]}),
        ("operational_mode", {"mode": "FUN"}),
        ("speed_slider", {"fraction": 2}),
        ("safeguard_stop", {"on": "yes"}),
        ("silence", {"wire": "usb"}),
    ]:
        with pytest.raises(ControlError):
            ur.do(command, **arguments)
    ur.do("power", on=False)
    with pytest.raises(ControlError, match="POWER_OFF"):
        ur.do("foreign_program", on=True)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_the_fake_ends_at_once_and_cleanly(start_ur, number):
    fake = start_ur()
    with RtdeSocket(fake) as rtde:
        rtde.outputs(b"timestamp")
        rtde.ask(b"S")
        fake.process.send_signal(number)
        assert fake.process.wait(30.0) == 0


def test_a_used_port_is_reported_in_one_line(ur):
    second = run_fake("ur", "--host", ur.host)
    assert second.returncode == 1
    assert second.stdout == ""
    assert len(second.stderr.splitlines()) == 1
    assert ur.host in second.stderr


@pytest.mark.parametrize(
    "options", [["--model", "ur99"], ["--controller-version", "x"], ["--control", "nowhere"], ["--frequency", "0"]]
)
def test_invalid_options_are_named(options):
    run = run_fake("ur", *options)
    assert run.returncode in (1, 2)
    assert options[1] in run.stderr


def test_the_fake_ends_with_its_parent():
    parent = subprocess.Popen(
        [
            sys.executable,
            "-c",
            "import subprocess, sys, time\n"
            "p = subprocess.Popen([sys.executable, '-m', 'arcor2_fakes.ur', *sys.argv[1:]],"
            " stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)\n"
            "print(p.pid, p.stdout.readline(), flush=True)\n"
            "time.sleep(60)",
            *("--rtde-port", "0", "--script-port", "0", "--dashboard-port", "0", "--primary-port", "0"),
            *("--secondary-port", "0"),
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert parent.stdout is not None
    pid = int(parent.stdout.readline().split()[0])
    child = psutil.Process(pid)
    parent.kill()
    parent.wait()
    parent.stdout.close()
    # Without a process that reaps orphans, an ended process remains as a zombie.
    wait_for(lambda: not child.is_running() or child.status() == psutil.STATUS_ZOMBIE)


def test_control_port_survives_faults_of_the_wires(ur):
    ur.do("silence")
    ur.do("refuse")
    with BlockingControlClient(ur.ready["control"]) as control:
        assert control.do("truth")["robot_mode"] == "RUNNING"
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(parse_address(ur.ready["dashboard"]), 1.0)
    ur.do("heal")
    socket.create_connection(parse_address(ur.ready["dashboard"]), 1.0).close()
