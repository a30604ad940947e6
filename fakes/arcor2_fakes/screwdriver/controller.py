"""The controller: its clients, its refusals, and the data of its telegrams."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Protocol

import msgspec

from arcor2_fakes.screwdriver.telegram import Message, numbered

if TYPE_CHECKING:
    from arcor2_fakes.screwdriver.tool import Alarm, Tightening, Tool

_PLAIN = {3: 1, 18: 1, 42: 1, 43: 1, 63: 1, 73: 1, 78: 1}  # highest revision of each message
_NAME = "Fake controller"
_INVALID, _NO_PROGRAM, _PROGRAM_BLOCKED, _NO_JOB, _JOB_BLOCKED = 1, 2, 3, 17, 20
_RESULTS_EXIST, _NO_RESULTS, _ALARMS_EXIST, _NO_ALARMS, _NO_ALARM = 9, 10, 11, 12, 58
_DISABLED, _CLIENT_CONNECTED, _REVISION, _UNKNOWN = 92, 96, 97, 99


class Options(msgspec.Struct, frozen=True):
    """Properties of the controller."""

    clients: int = 5
    start_revision: int = 6
    result_revision: int = 2
    alarm_revision: int = 2
    job_revision: int = 2
    binary: bool = False
    """Whether the bit fields of a result are bytes, as in older controllers, instead of digits."""
    lock_on_loss: bool = False
    """Whether the tool is disabled when a client disconnects without MID 0003."""


class Client(Protocol):
    """A connected client, as the controller uses it."""

    started: bool
    """Whether the client has started the communication."""
    results: tuple[int, bool] | None
    """Revision and no-ack flag of its subscription to results."""
    alarms: int | None
    """Revision of its subscription to alarms."""

    @property
    def unacknowledged(self) -> int:
        """Return the number of events that the client has not acknowledged."""
        ...

    def close(self) -> None:
        """Stop the communication."""

    def report_result(self, result: Tightening) -> None:
        """Send a result if the client has subscribed."""

    def report_alarm(self, alarm: Alarm) -> None:
        """Send an alarm that has just been raised."""

    def report_alarm_status(self, alarm: Alarm) -> None:
        """Send an alarm that was active before the subscription."""

    def report_cleared(self, alarm: Alarm) -> None:
        """Report that an alarm was acknowledged at the controller."""


class Controller:
    """A tightening controller with one tool.

    Args:
        tool: The tool.
        options: Properties.
        response_timeout: Time in which a client has to acknowledge an event, s.
        keep_alive_timeout: Time without a message after which a client is disconnected, s.
    """

    def __init__(self, tool: Tool, options: Options, *, response_timeout: float, keep_alive_timeout: float) -> None:
        self.tool, self.options = tool, options
        self.response_timeout, self.keep_alive_timeout = response_timeout, keep_alive_timeout
        self.clients: set[Client] = set()
        self.received: deque[str] = deque(maxlen=200)
        self.deaf = 0
        """Number of acknowledgements that get lost."""
        self.commands_disabled = False
        self.tool_data_revision = 2
        """Highest revision of MID 0041; 0: not supported."""
        tool.finished = self._finished
        tool.alarm_raised = self._alarm_raised
        tool.alarm_cleared = self._alarm_cleared

    def left(self, client: Client, was_started: bool) -> None:
        """Remove a client whose connection is closed."""
        self.clients.discard(client)
        if was_started and self.options.lock_on_loss:
            self.tool.enable(False)

    # ------------------------------------------------------------------------------------------------ events

    def _finished(self, result: Tightening) -> None:
        for client in tuple(self.clients):
            client.report_result(result)

    def _alarm_raised(self, alarm: Alarm) -> None:
        for client in tuple(self.clients):
            client.report_alarm(alarm)

    def _alarm_cleared(self, alarm: Alarm) -> None:
        for client in tuple(self.clients):
            client.report_cleared(alarm)

    # ------------------------------------------------------------------------------------------------ messages

    def refusal(self, client: Client, message: Message) -> int:
        """Return the error code that refuses a message; 0 if it is accepted."""
        limits = _PLAIN | {
            1: self.options.start_revision,
            40: self.tool_data_revision,
            38: self.options.job_revision,
            60: self.options.result_revision,
            70: self.options.alarm_revision,
        }
        if message.mid not in limits or limits[message.mid] == 0:
            return _UNKNOWN
        if message.revision > limits[message.mid]:
            return _REVISION
        match message.mid:
            case 1:
                others = sum(each.started for each in self.clients)
                return _CLIENT_CONNECTED if client.started or others >= self.options.clients else 0
            case 60:
                return _RESULTS_EXIST if client.results is not None else 0
            case 63:
                return _NO_RESULTS if client.results is None else 0
            case 70:
                return _ALARMS_EXIST if client.alarms is not None else 0
            case 73:
                return _NO_ALARMS if client.alarms is None else 0
            case 18 | 38 | 42 | 43 | 78 if self.commands_disabled:
                return _DISABLED
            case 18:
                return self._refused_number(message.data, 3, self.tool.programs, 1, _NO_PROGRAM, _PROGRAM_BLOCKED)
            case 38:
                digits = 2 if message.revision == 1 else 4
                return self._refused_number(message.data, digits, self.tool.jobs, 0, _NO_JOB, _JOB_BLOCKED)
            case 78:
                return _NO_ALARM if self.tool.alarm is None else 0
        return 0

    def _refused_number(self, data: bytes, digits: int, highest: int, lowest: int, missing: int, blocked: int) -> int:
        if len(data) != digits or not data.isdigit():
            return _INVALID
        if not lowest <= int(data) <= highest:
            return missing
        return blocked if self.tool.running else 0

    def execute(self, client: Client, message: Message) -> None:
        """Execute an accepted message, after it was answered."""
        match message.mid:
            case 3:
                client.close()
            case 18:
                self.tool.program = int(message.data)
            case 38:
                self.tool.job = int(message.data)
            case 42 | 43:
                self.tool.enable(message.mid == 43)
            case 60:
                client.results = message.revision, message.no_ack
            case 63:
                client.results = None
            case 70:
                client.alarms = message.revision
                if self.tool.alarm is not None:
                    client.report_alarm_status(self.tool.alarm)
            case 73:
                client.alarms = None
            case 78:
                self.tool.clear_alarm()

    # ------------------------------------------------------------------------------------------------ data fields

    def introduction(self, revision: int) -> bytes:
        """Return the data field of MID 0002."""
        versions = ("2.8".ljust(19), "1.4.0".ljust(19), "3.2".ljust(19))
        later: list[tuple[str, ...]] = [("FKE",), versions, ("RBU".ljust(24), "SN00012345"), ("001", "001")]
        later.append(("0", "0", "0000000001", "Station 1".ljust(25), "1"))
        values = ["0001", "01", _NAME.ljust(25)]
        for more in later[: revision - 1]:
            values += more
        return numbered(*values)

    def tool_data(self, revision: int) -> bytes:
        """Return the data field of MID 0041."""
        made = self.tool.made
        values = ["TOOL0000012345", f"{made:010d}", "2026-01-05:08:00:00", "SN00012345"]
        if revision == 2:
            values += ["001200", "2026-02-01:12:00:00", f"{made - self.tool.serviced:010d}"]
            values += ["01", "01", "000", "1.4.0".ljust(19)]
        return numbered(*values)

    def result_data(self, result: Tightening, revision: int) -> bytes:
        """Return the data field of MID 0061. Torque is in 1/100 N m."""
        ok, torque_status, angle_status = str(int(result.ok)), str(result.torque_status), str(result.angle_status)
        low, high, target = (f"{round(each * 100):06d}" for each in result.torque_limits)
        torques = (low, high, target, f"{round(result.torque * 100):06d}")
        least, most, aim = (f"{each:05d}" for each in result.angle_limits)
        angles = (least, most, aim, f"{result.angle:05d}")
        at = result.at.strftime("%Y-%m-%d:%H:%M:%S")
        changed = "2026-01-01:00:00:00"
        first = ("0001", "01", _NAME.ljust(25), " " * 25)
        batch = ("0000", "0000")
        if revision == 1:
            job, program = f"{result.job % 100:02d}", f"{result.program:03d}"
            statuses = (ok, torque_status, angle_status)
            last = (at, changed, "2", f"{result.id:010d}")
            return numbered(*first, job, program, *batch, *statuses, *torques, *angles, *last)
        options = b"\x02\x00\x00\x00\x00" if self.options.binary else b"00002"
        errors = b"\x00\x08" + bytes(8) if self.options.binary else b"0000000000"
        return numbered(
            *first,
            f"{result.job:04d}",
            f"{result.program:03d}",
            "02",
            options,
            *batch,
            ok,
            "2",
            torque_status,
            angle_status,
            *("1" * 5),
            errors,
            *torques,
            *angles,
            *("00000", "09999", "00720"),
            *("000", "150", "080"),
            *(["000000"] * 6),
            f"{result.id:010d}",
            *("00000", "00000", "TOOL0000012345"),
            *(at, changed),
        )
