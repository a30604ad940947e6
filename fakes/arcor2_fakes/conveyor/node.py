"""The CANopen node (CiA 301) of the drive: NMT, PDOs, SDO server, heartbeat producer and consumer, EMCY, boot-up."""

from __future__ import annotations

import asyncio
import contextlib
import struct
from collections import deque
from typing import Any

from arcor2_fakes.conveyor.dictionary import BAD_VALUE, NO_DATA, Abort, Dictionary, Entry, Setup, add_drive
from arcor2_fakes.conveyor.drive import HEARTBEAT_ERROR, Drive
from arcor2_fakes.conveyor.hub import Hub
from arcor2_fakes.conveyor.pdo import Rpdo, Tpdo
from arcor2_fakes.conveyor.sdo import SdoServer

TICK = 0.005
HELD_UP = 0.05  # s, longest step of the simulation
BOOT_TIME = 0.03
_OPERATIONAL, _STOPPED, _PRE_OPERATIONAL = 5, 4, 127
_PDO_TOO_SHORT = 0x8210
_GENERIC, _COMMUNICATION = 1, 1 << 4
_REGISTER = {0x2: 1 << 1, 0x3: 1 << 2, 0x4: 1 << 3, 0x81: _COMMUNICATION}  # 1001h: current, voltage, temperature
_INVALID = 1 << 31
_ERRORS_STORED = 8


class Node:
    """The node. `run` must run in the event loop of the hub."""

    def __init__(self, hub: Hub, number: int, time_scale: float = 1.0) -> None:
        self.number = number
        self._time_scale = time_scale
        self.silent = False
        self._hub = hub
        self._nmt = _PRE_OPERATIONAL
        self._booted_at = 0.0
        self.writes: deque[dict[str, Any]] = deque(maxlen=400)
        self.drive = Drive(self._emergency)
        self._setup = Setup()
        self._reset_communication()
        hub.listen(self._received)

    def _reset_communication(self) -> None:
        self._heartbeat_ms = 200
        self._consumer = 0
        self._heard: float | None = None
        self._master_lost = False
        self._next_heartbeat = 0.0
        self._emergency_id = 0x80 + self.number
        self._errors: deque[int] = deque(maxlen=_ERRORS_STORED)
        self.dictionary = dictionary = Dictionary()
        number, entries = self.number, dictionary.entries
        entries[0x1000, 0] = Entry("I", lambda: 0x00020192)  # servo drive, profile 402
        entries[0x1001, 0] = Entry("B", self._error_register)
        entries[0x1003, 0] = Entry("B", lambda: len(self._errors), self._clear_errors)
        for place in range(_ERRORS_STORED):
            entries[0x1003, place + 1] = Entry("I", lambda place=place: self._stored_error(place))  # type: ignore[misc]
        entries[0x1014, 0] = Entry("I", lambda: self._emergency_id, self._set_emergency_id)
        entries[0x1008, 0] = Entry("s", lambda: "SD-48 belt servo")
        entries[0x100A, 0] = Entry("s", lambda: "3.07")
        entries[0x1016, 0] = Entry("B", lambda: 1)
        entries[0x1016, 1] = Entry("I", lambda: self._consumer, self._set_consumer)
        entries[0x1017, 0] = Entry("H", lambda: self._heartbeat_ms, self._set_heartbeat)
        for subindex, value in enumerate((4, 0x3E7, 0x48, 0x307, 1000 + number)):
            entries[0x1018, subindex] = Entry("I" if subindex else "B", lambda value=value: value)  # type: ignore[misc]
        add_drive(dictionary, self.drive)
        self._setup.add_to(dictionary)
        self.pdos = (
            Tpdo(0, number, (0x6041,), dictionary, self._send_pdo),
            Tpdo(1, number, (0x6041, 0x6064), dictionary, self._send_pdo),
        )
        received = ((0x6040,), (0x6040, 0x6060), (0x6040, 0x607A), (0x6040, 0x60FF))
        self.rpdos = tuple(Rpdo(each, number, default, dictionary) for each, default in enumerate(received))
        self._sdo = SdoServer(dictionary, self._written)

    def _set_consumer(self, value: int) -> None:
        if value >> 24 or (value & 0xFFFF and not 1 <= value >> 16 <= 127):
            raise Abort(BAD_VALUE)
        self._consumer, self._heard = value, None  # monitoring starts with the first heartbeat

    def _set_heartbeat(self, value: int) -> None:
        self._heartbeat_ms, self._next_heartbeat = value, 0.0

    def _set_emergency_id(self, value: int) -> None:
        valid = not value & _INVALID
        if valid and (not 0 < value <= 0x7FF or (not self._emergency_id & _INVALID and value != self._emergency_id)):
            raise Abort(BAD_VALUE)  # 11 bits; changed only while it is invalid
        self._emergency_id = value

    def _clear_errors(self, value: int) -> None:
        if value:
            raise Abort(BAD_VALUE)
        self._errors.clear()

    def _stored_error(self, place: int) -> int:
        if place >= len(self._errors):
            raise Abort(NO_DATA)
        return self._errors[place]

    def _written(self, index: int, subindex: int, data: bytes) -> None:
        self.writes.append({"index": index, "subindex": subindex, "data": data.hex()})

    def _error_register(self) -> int:
        code = self.drive.error_code
        fault = _GENERIC | _REGISTER.get(code >> 8, _REGISTER.get(code >> 12, 0)) if code else 0
        return fault | (_GENERIC | _COMMUNICATION if self._master_lost else 0)

    # -------------------------------------------------------------------------------- life
    async def run(self) -> None:
        """Boot, then advance the drive and monitor heartbeats until cancelled."""
        loop = asyncio.get_running_loop()
        before = loop.time()
        while True:
            await asyncio.sleep(TICK)
            now = loop.time()
            passed = min(now - before, HELD_UP)
            self.drive.advance(passed * self._time_scale)
            if self._heard is not None:  # while this process was not scheduled, a heartbeat may have arrived
                self._heard += now - before - passed
            before = now
            if self._booted_at and now >= self._booted_at:
                self._booted_at, self._nmt = 0.0, _PRE_OPERATIONAL
                self._send(0x700, b"\x00")
            if self._booted_at:
                continue
            if self._heartbeat_ms and now >= self._next_heartbeat:
                self._next_heartbeat = now + self._heartbeat_ms / 1000.0
                self._send(0x700, bytes([self._nmt]))
            self._watch_master(now)
            if self._nmt == _OPERATIONAL:
                for pdo in self.pdos:
                    pdo.tick(now)

    def _watch_master(self, now: float) -> None:
        limit = self._consumer & 0xFFFF
        if self._heard is None or not limit or now - self._heard <= limit / 1000.0:
            return
        self._heard, self._master_lost = None, True
        if self._nmt == _OPERATIONAL:
            self._nmt = _PRE_OPERATIONAL  # 1029h:01 = 0
        self._emergency(HEARTBEAT_ERROR)
        self.drive.connection_aborted()

    def power_cycle(self, belt: float | None = None) -> None:
        """Switch off and on: volatile values are lost; the belt is stopped, or was moved to `belt` counts."""
        self.drive.power_on(self.drive.belt if belt is None else float(belt))
        self._setup.power_cycle()
        self.writes.clear()
        self._hub.frames.clear()
        self._boot()

    def _boot(self) -> None:
        self._reset_communication()
        self._booted_at = asyncio.get_running_loop().time() + BOOT_TIME

    # -------------------------------------------------------------------------------- frames
    def _send(self, service: int, data: bytes) -> None:
        if not self.silent and not self._booted_at:
            self._hub.transmit(service + self.number, data)

    def _send_pdo(self, identifier: int, data: bytes) -> None:
        if not self.silent:
            self._hub.transmit(identifier, data)

    def _emergency(self, code: int) -> None:
        if code:
            self._errors.appendleft(code)
        valid = not self._emergency_id & _INVALID and self._nmt != _STOPPED
        if valid and not self.silent and not self._booted_at:
            self._hub.transmit(self._emergency_id, struct.pack("<HB5x", code, self._error_register()))

    def _received(self, identifier: int, data: bytes) -> None:
        if self.silent or self._booted_at:
            return
        if identifier == 0 and len(data) == 2 and data[1] in (0, self.number):
            self._nmt_command(data[0])
        elif identifier == 0x600 + self.number and len(data) == 8 and self._nmt != _STOPPED:
            if answer := self._sdo.answer(data):
                self._send(0x580, answer)
        elif identifier == 0x700 + (self._consumer >> 16 & 0x7F) and self._consumer & 0xFFFF:
            self._heard = asyncio.get_running_loop().time()
            if self._master_lost:
                self._master_lost = False
                self._emergency(self.drive.error_code)
        elif self._nmt == _OPERATIONAL:
            for pdo in self.rpdos:
                if pdo.cob_id == identifier:
                    self._receive_pdo(pdo, data)

    def _receive_pdo(self, pdo: Rpdo, data: bytes) -> None:
        """Write the values of a PDO; those that a drive refuses have no effect."""
        values = pdo.received(data)
        if values is None:
            self._emergency(_PDO_TOO_SHORT)
        for index, subindex, value in values or ():
            self._written(index, subindex, value)
            with contextlib.suppress(Abort):
                self.dictionary.write(index, subindex, value)

    def _nmt_command(self, command: int) -> None:
        if command in (129, 130):  # reset node, reset communication
            if command == 129:
                self.power_cycle()
            else:
                self.drive.connection_aborted()
                self._boot()
            return
        states = {1: _OPERATIONAL, 2: _STOPPED, 128: _PRE_OPERATIONAL}
        if command in states:
            left, self._nmt = self._nmt == _OPERATIONAL, states[command]
            if left and self._nmt != _OPERATIONAL:
                self.drive.connection_aborted()

    # -------------------------------------------------------------------------------- truth
    def motion(self) -> dict[str, float]:
        """Return position and velocity of the belt, counts and counts/s; the cell reads them 100 times per second."""
        return {"belt": self.drive.belt, "velocity": self.drive.velocity}

    def truth(self) -> dict[str, Any]:
        """Return the real state, for tests."""
        drive = self.drive
        return {
            "state": drive.state.name.lower(),
            "mode": int(drive.mode),
            "nmt": self._nmt,
            "booted": not self._booted_at,
            "belt": drive.belt,
            "position": drive.position,
            "velocity": drive.velocity,
            "homed": drive.homed,
            "error_code": drive.error_code,
            "consumer": self._consumer,
            "abort_option": drive.parameters.abort_option,
            "parameters": dict(vars(drive.parameters)),
            "writes": list(self.writes),
            "frames": list(self._hub.frames),
            "pdos_sent": [pdo.sent for pdo in self.pdos],
        }
