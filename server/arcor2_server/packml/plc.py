"""The PLC above the cell: the registers of its Modbus block, its requests, and its life counter."""

import asyncio
import enum
import socket
import time
from collections.abc import Sequence
from typing import Final

import structlog

from arcor2_hw.data.audit import AuditOutcome
from arcor2_hw.data.base import UNSET
from arcor2_hw.data.cell_state import CellAuthority, CellMode, PlcLink
from arcor2_hw.data.held import OnError
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.packml import MachineCommand, MachineState, UnitMode
from arcor2_hw.exceptions import Arcor2Error, NotFound, StorageError
from arcor2_hw.messages import Message
from arcor2_server.alarms.service import Alarms
from arcor2_server.audit.trail import AuditTrail
from arcor2_server.background import BackgroundTasks
from arcor2_server.errors import RequestRefused
from arcor2_server.execution.package_runs import PackageRuns
from arcor2_server.execution.runs import RunStart
from arcor2_server.packml.cell import PackmlCell
from arcor2_server.packml.modbus import ExceptionCode, ModbusRefusal, ModbusServer
from arcor2_server.packml.record import CellFile, JobEnd, PlantRequest, RequestResult
from arcor2_server.packml.states import COMMANDS

log = structlog.get_logger(__name__)
R = RequestResult

VERSION: Final = 1
"""Version of the block."""
LIFE_RATE: Final = 10.0
"""Rate at which the life counter of the cell counts, 1/s."""
CHECKS: Final = 8
"""Number of checks of the PLC's life counter within its time limit."""
MAX_WAITING: Final = 16
"""Maximum number of requests that wait for the execution of the previous one."""
MAX_PLANT_REQUESTS: Final = 64
"""Number of stored requests of plant systems."""
SILENT: Final = "plc_silent"
"""Code of the alarm for a life counter that does not change."""
_STOPPING: Final = frozenset({MachineCommand.STOP, MachineCommand.ABORT})
"""Commands that need neither authority nor mode."""

_NO_AUTHORITY: Final = Message.of("The PLC does not have the authority over the cell.")


class Input(enum.IntEnum):
    """Addresses of the input registers, which the PLC reads."""

    VERSION = 0
    LIFE = 1
    STATE = 2
    MODE = 3
    AUTHORITY = 4
    STATUS = 5
    REQUEST = 6
    RESULT = 7
    JOB = 8
    JOB_END = 9
    COMPLETED = 10


class Holding(enum.IntEnum):
    """Addresses of the holding registers, which the PLC writes."""

    LIFE = 0
    COMMAND = 1
    JOB = 2
    REQUEST = 3


class Status(enum.IntFlag):
    """Bits of the status register."""

    READY = 1
    BUSY = 2
    DONE = 4
    ERROR = 8
    REFUSED = 16
    HELD = 32
    PERSON_NEEDED = 64
    PLC_SILENT = 128


_AUTHORITIES: Final = {CellAuthority.NOBODY: 0, CellAuthority.HUB: 1, CellAuthority.PLC: 2}


class Plc:
    """The PLC. Each request number is executed once; a frozen life counter holds the program.

    Args:
        cell: the cell.
        file: stores the last request.
        runs: starts packages.
        alarms: records alarms.
        audit: records commands.
        life_timeout: time after which a life counter that does not change counts as frozen, s.
    """

    def __init__(
        self,
        cell: PackmlCell,
        file: CellFile,
        runs: PackageRuns,
        alarms: Alarms,
        audit: AuditTrail,
        life_timeout: float,
    ) -> None:
        self._cell = cell
        self._file = file
        self._runs = runs
        self._alarms = alarms
        self._audit = audit
        self._life_timeout = life_timeout
        self._server = ModbusServer(self)
        self._listening = ""
        self._holding = [0] * len(Holding)
        self._peer = ""
        self._written_at = self._life_at = self._grace_until = float("-inf")
        self._silent = False
        self._hold_pending = False
        self._had_authority = False
        self._completed = 0
        record = file.record
        self._last_seen = record.request
        self._answered = record.request, record.result
        """The last executed request and its result."""
        self._job = record.job, record.job_end
        """The last job and its outcome. The file is updated afterwards."""
        self._waiting: asyncio.Queue[tuple[int, int, int]] = asyncio.Queue(MAX_WAITING)
        self._executing = asyncio.Lock()
        self._background = BackgroundTasks()
        cell.link = self.link
        cell.on_change.append(self._cell_changed)
        cell.on_job_end.append(self._job_ended)

    async def serve(self, listener: socket.socket) -> None:
        """Start to serve the PLC on a bound socket."""
        await self._server.serve(listener)
        host, port = listener.getsockname()[:2]
        self._listening = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
        self._background.spawn(self._execute_requests(), "requests of the PLC")
        self._background.spawn(self._watch_life(), "life counter of the PLC")
        log.info("Modbus block for the PLC", address=self._listening)
        self._cell.changed()

    async def close(self) -> None:
        """Disconnect the PLC."""
        await self._server.close()
        await self._background.cancel()

    def link(self) -> PlcLink | None:
        """Return the connection of the PLC; None if the server has no Modbus block."""
        if not self._listening:
            return None
        return PlcLink(self._listening, self._alive, self._peer or UNSET)

    @property
    def name(self) -> str:
        """The name of the PLC in messages and the audit trail."""
        return f"PLC {self._peer}" if self._peer else "PLC"

    # -------------------------------------------------------------------------------- registers
    def inputs(self) -> Sequence[int]:
        """Return the input registers."""
        cell = self._cell
        values = dict.fromkeys(Input, 0) | {
            Input.VERSION: VERSION,
            Input.LIFE: int(time.monotonic() * LIFE_RATE),
            Input.STATE: cell.state,
            Input.MODE: cell.mode,
            Input.AUTHORITY: _AUTHORITIES[cell.authority],
            Input.STATUS: self._status(),
            Input.REQUEST: self._answered[0],
            Input.RESULT: self._answered[1],
            Input.JOB: self._job[0],
            Input.JOB_END: self._job[1],
            Input.COMPLETED: self._completed,
        }
        return [values[each] & 0xFFFF for each in Input]

    def holding(self) -> Sequence[int]:
        """Return the holding registers."""
        return self._holding

    def _status(self) -> Status:
        cell, end = self._cell, self._job[1]
        bits = {
            Status.READY: cell.state is MachineState.IDLE
            and cell.authority is CellAuthority.PLC
            and cell.mode is UnitMode.PRODUCE
            and self._alive,
            Status.BUSY: bool(cell.job),
            Status.DONE: end is JobEnd.COMPLETED,
            Status.ERROR: cell.state is MachineState.ABORTED or end in (JobEnd.FAILED, JobEnd.LOST),
            Status.REFUSED: self._answered[1] is not R.ACCEPTED,
            Status.HELD: cell.state is MachineState.HELD,
            Status.PERSON_NEEDED: cell.person_needed,
            Status.PLC_SILENT: not self._alive,
        }
        return Status(sum(bit for bit, is_set in bits.items() if is_set))

    def write(self, address: int, values: Sequence[int], peer: str) -> None:
        """Write holding registers. A new request number requests the command that the registers then contain.

        Raises:
            ModbusRefusal: another PLC writes, or too many requests wait.
        """
        moment = time.monotonic()
        if peer != self._peer and moment - self._written_at < self._life_timeout:
            raise ModbusRefusal(ExceptionCode.BUSY)
        changed = list(self._holding)
        changed[address : address + len(values)] = values
        request = changed[Holding.REQUEST]
        is_new = address <= Holding.REQUEST < address + len(values) and request not in (0, self._last_seen)
        if is_new and self._waiting.full():
            raise ModbusRefusal(ExceptionCode.BUSY)
        life_changed = changed[Holding.LIFE] != self._holding[Holding.LIFE]
        self._holding, self._peer, self._written_at = changed, peer, moment
        if life_changed:
            self._life_at = moment
            self._recovered()
        if is_new:
            self._last_seen = request
            self._waiting.put_nowait((request, changed[Holding.COMMAND], changed[Holding.JOB]))

    # -------------------------------------------------------------------------------- life counter
    @property
    def _alive(self) -> bool:
        return time.monotonic() - self._life_at <= self._life_timeout

    async def _watch_life(self) -> None:
        period, was_alive = self._life_timeout / CHECKS, False
        while True:
            due = time.monotonic() + period
            await asyncio.sleep(period)
            if time.monotonic() - due > period:
                continue  # the server was delayed, so unread requests of the PLC may be waiting
            if self._alive is not was_alive:
                was_alive = self._alive
                self._cell.changed()
            if not self._alive and self._cell.authority is CellAuthority.PLC and due > self._grace_until:
                self._frozen()

    def _frozen(self) -> None:
        """Raise the alarm and hold the program of the PLC, once until the life counter changes again."""
        if self._silent:
            return
        self._silent = self._hold_pending = True
        log.warning("life counter of the PLC frozen", plc=self._peer)
        if self._peer:
            text = Message.of(
                "The life counter of the PLC at {address} has not changed for {limit:.1f} s.",
                address=self._peer,
                limit=self._life_timeout,
            )
        else:
            text = Message.of("The PLC has the authority over the cell, but has not connected to it.")
        self._alarms.system(SILENT, True, text)
        self._hold_if_running()

    def _hold_if_running(self) -> None:
        """Hold the program as soon as that is possible, if the life counter has frozen."""
        if not self._hold_pending:
            return
        match self._cell.program_state:
            case PackageStateEnum.RUNNING:
                self._hold_pending = False
                try:
                    self._cell.hold(by_plc=False)
                except RequestRefused as error:  # the program has just ended
                    log.warning("program not held", reason=str(error))
            case PackageStateEnum.STARTED | PackageStateEnum.RESUMING:
                pass  # it runs soon
            case _:
                self._hold_pending = False

    def _recovered(self) -> None:
        if self._silent:
            self._silent = self._hold_pending = False
            self._alarms.system(SILENT, False)

    def _cell_changed(self) -> None:
        has_authority = self._cell.authority is CellAuthority.PLC
        if has_authority and not self._had_authority:
            self._grace_until = time.monotonic() + self._life_timeout
        elif not has_authority:
            self._recovered()
        self._had_authority = has_authority
        self._hold_if_running()

    # -------------------------------------------------------------------------------- requests
    async def _execute_requests(self) -> None:
        while True:
            request, command, job = await self._waiting.get()
            try:
                await self._store_request(request, command)
                async with self._executing:
                    result, text = await self._execute(command, job)
            except Arcor2Error as error:
                result, text = R.REFUSED, error.message
            except Exception as error:
                log.exception("request of the PLC failed", request=request)
                result, text = R.REFUSED, Message.of("An error inside the server: {reason}", reason=error)
            self._note(command, job, result, text)
            try:
                await self._file.put(result=result)
            except Arcor2Error as error:
                log.error("result of a request of the PLC not stored", reason=str(error))
            self._answered = request, result

    async def _store_request(self, request: int, command: int) -> None:
        """Store a request before it is executed, so that no restart repeats it. A full disk does not prevent a stop."""
        try:
            await self._file.put(request=request, result=R.INTERRUPTED)
        except StorageError as error:
            if command not in _STOPPING:
                raise
            log.error("stop of the PLC not stored", reason=str(error))

    async def execute_once(self, command: int, job: int, by: str, request: str) -> tuple[RequestResult, Message | None]:
        """Execute a command of a plant system, which has no life counter. Return result and reason.

        Args:
            command: number of the command.
            job: number of the job for Start.
            by: name of the client and its user.
            request: identifies the request. The same one is executed once, also after a restart. Empty: no identifier.
        """
        async with self._executing:
            known = [each for each in self._file.record.plant_requests if each.id == request]
            if request and known:
                return known[0].result, Message.of(known[0].text) if known[0].text else None
            await self._store_plant_request(request, command, R.INTERRUPTED, "The server ended during the request.")
            try:
                result, text = await self._execute(command, job, by)
            except Arcor2Error as error:
                result, text = R.REFUSED, error.message
            await self._store_plant_request(request, command, result, "" if text is None else text.text)
            return result, text

    async def set_mode(self, mode: UnitMode, by: str) -> tuple[RequestResult, Message | None]:
        """Change the mode for a plant system; return the result and the reason for a refusal."""
        async with self._executing:
            if self._cell.authority is not CellAuthority.PLC:
                return R.NO_AUTHORITY, _NO_AUTHORITY
            try:
                await self._cell.set_mode(CellMode[mode.name], by)
            except RequestRefused as error:
                return R.WRONG_STATE, error.message
            except Arcor2Error as error:
                return R.REFUSED, error.message
        return R.ACCEPTED, None

    async def _store_plant_request(self, request: str, command: int, result: RequestResult, text: str) -> None:
        if not request:
            return
        others = [each for each in self._file.record.plant_requests if each.id != request]
        try:
            await self._file.put(
                plant_requests=[*others[1 - MAX_PLANT_REQUESTS :], PlantRequest(request, result, text)]
            )
        except StorageError as error:
            if command not in _STOPPING:
                raise
            log.error("stop of a plant system not stored", reason=str(error))

    async def _execute(self, number: int, job: int, by: str = "") -> tuple[RequestResult, Message | None]:
        """Execute a command; return its result and the reason for a refusal. `by`: empty for the supervised PLC."""
        cell = self._cell
        alive = bool(by) or self._alive
        if number not in COMMANDS:
            return R.UNKNOWN_COMMAND, Message.of("The command {number} does not exist.", number=number)
        command = MachineCommand(number)
        if command not in _STOPPING and cell.authority is not CellAuthority.PLC:
            return R.NO_AUTHORITY, _NO_AUTHORITY
        try:
            cell.require(command)
        except RequestRefused as error:
            return R.WRONG_STATE, error.message
        match command:
            case MachineCommand.START:
                return await self._start(job, by or self.name, alive=alive)
            case MachineCommand.HOLD:
                cell.hold(by_plc=True)
            case MachineCommand.UNHOLD:
                if not alive:
                    return R.LIFE_COUNTER_FROZEN, Message.of("The life counter of the PLC does not change.")
                if cell.person_needed:
                    return R.PERSON_NEEDED, Message.of("The program is held at a failed action. A person decides.")
                cell.unhold()
            case _:
                await cell.end(command, by or self.name)
        return R.ACCEPTED, None

    async def _start(self, number: int, by: str, *, alive: bool) -> tuple[RequestResult, Message | None]:
        cell = self._cell
        if not alive:
            return R.LIFE_COUNTER_FROZEN, Message.of("The life counter of the PLC does not change.")
        try:
            cell.require_mode()
        except RequestRefused as error:
            return R.WRONG_MODE, error.message
        job = next((job for job in cell.jobs if job.number == number), None)
        if job is None:
            return R.UNKNOWN_JOB, Message.of("There is no job {number}.", number=number)
        before = self._job
        await self._set_job(number, JobEnd.RUNNING)
        try:
            with cell.starting(number):
                await self._runs.run_package(job.package_id, RunStart(by=by, on_error=OnError.HOLD, by_plc=True))
        except Arcor2Error as error:
            await self._set_job(*before)
            if isinstance(error, NotFound):
                return R.UNKNOWN_JOB, Message.of(
                    "Job {number} has no package: {reason}", number=number, reason=error.message
                )
            raise
        return R.ACCEPTED, None

    async def _set_job(self, job: int, end: JobEnd) -> None:
        self._job = job, end
        await self._file.put(job=job, job_end=end)

    def _job_ended(self, end: JobEnd) -> None:
        if end is JobEnd.COMPLETED:
            self._completed += 1
        self._job = self._job[0], end
        self._background.spawn(self._store_end(end), "end of a job of the PLC")

    async def _store_end(self, end: JobEnd) -> None:
        try:
            await self._file.put(job_end=end)
        except StorageError as error:
            log.error("end of a job of the PLC not stored", reason=str(error))

    def _note(self, command: int, job: int, result: RequestResult, text: Message | None) -> None:
        """Add a request to the audit trail, and raise an alarm if it was refused."""
        name = MachineCommand(command).name.capitalize() if command in COMMANDS else str(command)
        outcome = AuditOutcome.DONE if result is R.ACCEPTED else AuditOutcome.REFUSED
        target = f"job {job}" if command == MachineCommand.START else ""
        reason = "" if text is None else text.text
        self._audit.note(outcome, f"PLC {name}", target=target, user=self.name, address=self._peer, reason=reason)
        if text is not None:
            code = "plc_job_unknown" if result is R.UNKNOWN_JOB else "plc_request_refused"
            text = Message.of(
                "The request of the PLC at {address} was refused: {reason}", address=self._peer, reason=text
            )
            self._alarms.system(code, None, text)
