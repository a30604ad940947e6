"""The fake scale from the host's side: pyserial and the bytes of the MT-SICS command set."""

import time
from collections.abc import Iterator

import pytest
import serial

from tests.fakes.conftest import FakeProcess


class Line:
    """A host on the line."""

    def __init__(self, port: str) -> None:
        self.serial = serial.serial_for_url(port, timeout=30.0)

    def send(self, command: str) -> None:
        self.serial.write(command.encode() + b"\r\n")

    def read(self) -> str:
        line = self.serial.read_until(b"\r\n")
        assert line.endswith(b"\r\n"), f"no answer: {line!r}"
        return str(line[:-2], "ascii")

    def ask(self, command: str) -> str:
        self.send(command)
        return self.read()


@pytest.fixture(scope="module")
def running() -> Iterator[FakeProcess]:
    with FakeProcess("scale", "--settling", "0.2", "--stability-timeout", "0.3") as fake:
        yield fake


@pytest.fixture
def fake(running: FakeProcess) -> FakeProcess:
    running.control.do("renew")
    return running


@pytest.fixture
def line(fake: FakeProcess) -> Iterator[Line]:
    line = Line(fake.ready["port"])
    line.ask("@")
    yield line
    line.serial.close()


def put(fake: FakeProcess, kilograms: float) -> None:
    fake.control.do("put", kg=kilograms)
    fake.control.wait_until(lambda truth: truth["stable"])


def test_commands_on_the_wire(fake: FakeProcess, line: Line) -> None:
    assert line.ask("I4") == 'I4 A "B021002593"'
    fake.control.do("put", kg=0.1)
    assert line.ask("SI").startswith("S D ")
    assert line.ask("S") == "S S     100.00 g"  # once stable
    assert line.ask("T") == "T S     100.00 g"
    assert line.ask("SI") == "S S       0.00 g"
    assert line.ask("@") == 'I4 A "B021002593"'
    assert line.ask("TA") == "TA A       0.00 g"
    assert line.ask("Z") == "Z +"
    put(fake, 9.0)
    assert line.ask("S") == "S +"
    fake.control.do("put", kg=0.0)
    fake.control.do("vibrate", on=True)
    fake.control.do("unit", value="kg")
    assert line.ask("S") in ("S I", "S +")
    fake.control.do("error", code="ET")
    assert line.ask("SI") == "ET"


def test_every_command_of_the_claimed_levels_exists(line: Line) -> None:
    assert line.ask("I1") == 'I1 A "01" "2.30" "2.20" "" ""'
    line.send("I0")
    listed = [line.read()]
    while listed[-1].startswith("I0 B "):
        listed.append(line.read())
    assert listed[-1] == 'I0 A 2 "M35"'
    levels: dict[str, set[str]] = {"0": set(), "1": set(), "2": set()}
    for each in listed:
        _, _, level, name = each.split()
        levels[level].add(name.strip('"'))
    assert levels == {
        "0": {"@", "I0", "I1", "I2", "I3", "I4", "I5", "S", "SI", "SIR", "Z", "ZI"},
        "1": {"D", "DW", "K", "SR", "T", "TA", "TAC", "TI"},
        "2": {"M01", "M02", "M03", "M35"},
    }
    for name in set.union(*levels.values()):
        answer = line.ask(name)
        line.send("@")
        while line.read() != 'I4 A "B021002593"':
            pass  # further lines of I0 and SIR
        assert answer not in ("ES", "ET", "EL"), name
    assert line.ask("I2") == 'I2 A "MS3002S 3.2 kg"'
    assert line.ask("I3") == 'I3 A "2.10 10.28.0.493.142"'
    assert line.ask("I5") == 'I5 A "12121306C"'


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        ("XY", "ES"),
        ("s", "ES"),
        ("SX", "ES"),
        ("I6", "ES"),
        ("M99", "ES"),
        ("@ 1", "ES"),
        (" S", "ES"),
        ("S" * 100, "ES"),
        ("T 5", "EL"),
        ("S 1", "EL"),
        ("Z 1", "EL"),
        ("I4 1", "EL"),
        ("SIR 1", "EL"),
        ("TAC 1", "EL"),
        ("TA 5", "TA L"),
        ("TA -5.00 g", "TA L"),
        ("TA 5.00 oz", "TA L"),
        ("TA 9.00 kg", "TA L"),
        ("SR 5", "S L"),
        ("SR x g", "S L"),
        ("D", "D L"),
        ("D text", "D L"),
        ("K", "K L"),
        ("K 0", "K L"),
        ("K 5", "K L"),
    ],
)
def test_wrong_commands(line: Line, command: str, answer: str) -> None:
    assert line.ask(command) == answer
    assert line.ask("SI") == "S S       0.00 g"


def test_preset_tare(fake: FakeProcess, line: Line) -> None:
    assert line.ask("TA 12.345 g") == "TA A      12.35 g"
    assert line.ask("SI") == "S S     -12.35 g"
    assert line.ask("TA 0.1 kg") == "TA A     100.00 g"
    assert line.ask("TAC") == "TAC A"
    assert line.ask("TA") == "TA A       0.00 g"
    fake.control.do("put", kg=0.05)
    assert line.ask("TI").startswith("TI D ")
    fake.control.wait_until(lambda truth: truth["stable"])
    assert line.ask("TI") == "TI S      50.00 g"
    fake.control.do("busy", on=True)
    for command, answer in (("TA", "TA I"), ("TAC", "TAC I"), ('D "a"', "D I"), ("SIR", "S I"), ("SR", "S I")):
        assert line.ask(command) == answer


def test_sir_repeats_until_another_weighing(fake: FakeProcess, line: Line) -> None:
    put(fake, 0.1)
    began = time.monotonic()
    line.send("SIR")
    assert [line.read() for _ in range(5)] == ["S S     100.00 g"] * 5
    assert time.monotonic() - began > 0.3
    fake.control.do("put", kg=0.2)
    while line.read() != "S S     200.00 g":
        pass
    line.send("TA")  # is answered between them
    while line.read() != "TA A       0.00 g":
        pass
    assert line.read() == "S S     200.00 g"
    line.send("SI")
    while (answer := line.read()) != "S S     200.00 g":
        raise AssertionError(answer)
    line.serial.timeout = 0.3
    assert line.serial.read_until(b"\r\n", 100).strip() in (b"", b"S S     200.00 g")  # one may have been sent before
    assert line.serial.read(1) == b""
    line.serial.timeout = 30.0
    line.send("SIR")
    assert line.read() == "S S     200.00 g"
    line.send("@")
    while line.read() != 'I4 A "B021002593"':
        pass
    line.serial.timeout = 0.3
    assert line.serial.read(1) == b""


def test_sr_sends_after_a_change_of_the_weight(fake: FakeProcess, line: Line) -> None:
    put(fake, 0.1)
    assert line.ask("SR 10.00 g") == "S S     100.00 g"
    put(fake, 0.105)  # less than the preset
    put(fake, 0.2)
    dynamic = line.read()
    assert dynamic.startswith("S D ")
    assert 110.0 <= float(dynamic.split()[2]) < 200.0
    assert line.read() == "S S     200.00 g"
    assert line.ask("SR") == "S S     200.00 g"  # without a preset: 12.5 %
    put(fake, 0.22)
    put(fake, 0.23)
    assert line.read().startswith("S D ")
    assert line.read() == "S S     230.00 g"
    fake.control.do("put", kg=9.0)
    while (answer := line.read()).startswith("S D "):
        pass
    assert answer == "S +"
    put(fake, 0.1)
    while (answer := line.read()) != "S S     100.00 g":
        assert answer == "S +" or answer.startswith("S D ")
    assert line.ask("S") == "S S     100.00 g"
    put(fake, 0.5)
    line.serial.timeout = 0.3
    assert line.serial.read(1) == b""  # S has ended it
    line.serial.timeout = 30.0
    fake.control.do("vibrate", on=True)
    assert line.ask("SR") == "S I"


def test_display_and_keys(fake: FakeProcess, line: Line) -> None:
    assert line.ask('D "PUT PART"') == "D A"
    assert fake.truth()["display"] == "PUT PART"
    assert line.ask('D "0123456789ABCDEFGHIJ"') == "D R"
    assert fake.truth()["display"] == "456789ABCDEFGHIJ"
    assert line.ask("DW") == "DW A"
    assert fake.truth()["display"] is None
    put(fake, 0.05)
    fake.control.do("press", key="tare")
    assert line.ask("TA") == "TA A      50.00 g"
    assert line.ask("K 2") == "K A"
    put(fake, 0.06)
    fake.control.do("press", key="tare")
    assert line.ask("TA") == "TA A      50.00 g"
    assert line.ask("K 3") == "K A"
    fake.control.do("press", key="tare")
    assert line.read() == "K C 2"
    assert line.ask("TA") == "TA A      50.00 g"
    assert line.ask("K 4") == "K A"
    fake.control.do("press", key="tare")
    assert [line.read(), line.read()] == ["K B 2", "K A 2"]
    assert line.ask("TA") == "TA A      60.00 g"
    put(fake, 1.0)
    fake.control.do("press", key="zero")
    assert [line.read(), line.read()] == ["K B 1", "K I 1"]  # beyond the zero range
    line.ask("@")
    assert fake.truth()["keys"] == 1
