"""The cell as a unit of PackML: state, mode, authority, and the rules that follow from them."""

import contextlib
from collections.abc import Callable, Iterator, Mapping
from typing import Final

import structlog
from msgspec import UNSET

from arcor2_hw.data.cell_state import CellAuthority, CellJob, CellMode, CellStateName, CellStatus, PlcLink
from arcor2_hw.data.editor import RunEnd
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.packml import MachineCommand, MachineState, UnitMode
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import Conflict
from arcor2_hw.messages import Message, translatable
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub, make_event
from arcor2_server.execution.runs import Runs, RunStart
from arcor2_server.execution.service import Execution
from arcor2_server.execution.stop_all import StopAll
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.packml.record import CellFile, JobEnd
from arcor2_server.packml.states import CellStates

log = structlog.get_logger(__name__)

CHANGED: Final = "CellChanged"
"""The additional event with the state of the cell."""
_PLC_HAS_AUTHORITY: Final = (
    "The PLC has the authority over the cell. A technician takes it back first. Stop works at any time."
)
_MODES: Final[Mapping[CellMode, str]] = translatable(
    {
        CellMode.PRODUCE: "produce",
        CellMode.MAINTENANCE: "maintenance",
        CellMode.MANUAL: "manual",
        CellMode.CHANGEOVER: "changeover",
    }
)
_JOB_ENDS: Final = {
    MachineState.COMPLETE: JobEnd.COMPLETED,
    MachineState.STOPPED: JobEnd.STOPPED,
    MachineState.ABORTED: JobEnd.FAILED,
}


class PackmlCell:
    """The cell. It permits or refuses starts; it never starts or resumes a program by itself.

    Args:
        hub: publishes CellChanged.
        execution: runs the programs.
        runs: the history of runs.
        online: the online scene.
        stop_all: stops everything.
        file: mode, authority and jobs.
    """

    def __init__(
        self,
        hub: EventHub,
        execution: Execution,
        runs: Runs,
        online: OnlineScene,
        stop_all: StopAll,
        file: CellFile,
    ) -> None:
        self._hub = hub
        self._execution = execution
        self._runs = runs
        self._last_program_state = execution.state
        self._online = online
        self._stop_all = stop_all
        self._file = file
        self._states = CellStates()
        self._published: CellStatus | None = None
        self._held_by_plc = False
        self.job = 0
        """The running job of the PLC; 0 if there is none."""
        self.link: Callable[[], PlcLink | None] = lambda: None
        """Returns the connection of the PLC; None without a Modbus block."""
        self.has_opcua = False
        """Whether plant systems can command the cell over OPC UA."""
        self.on_change: list[Callable[[], None]] = []
        """Called after each change of state, mode and authority."""
        self.on_job_end: list[Callable[[JobEnd], None]] = []
        """Called when a job of the PLC has ended."""
        execution.before_start.append(self._check_run)
        execution.before_resume.append(self._check_resume)
        execution.on_state.append(self._program_changed)
        online.before_start.append(self._check_online)

    # -------------------------------------------------------------------------------- state
    @property
    def state(self) -> MachineState:
        """The PackML state."""
        return self._states.present

    @property
    def mode(self) -> UnitMode:
        """The mode."""
        return UnitMode[self._file.record.mode.name]

    @property
    def authority(self) -> CellAuthority:
        """The client that may start programs."""
        return self._file.record.authority

    @property
    def jobs(self) -> list[CellJob]:
        """The jobs of the PLC by number."""
        return self._file.record.jobs

    @property
    def last_job(self) -> tuple[int, JobEnd]:
        """The last job of the PLC, 0 for none, and its outcome."""
        return self._file.record.job, self._file.record.job_end

    @property
    def program_state(self) -> PackageStateEnum:
        """The state of the program."""
        return self._execution.state

    @property
    def person_needed(self) -> bool:
        """Whether the program is held at a failed action until a person decides."""
        return self._execution.hold.present is not None

    def data(self) -> CellStatus:
        """Return the state for clients."""
        record, link = self._file.record, self.link()
        return CellStatus(
            CellStateName[self.state.name],
            record.mode,
            record.authority,
            record.jobs,
            self._held_by_plc,
            self.job or UNSET,
            UNSET if link is None else link,
            self.has_opcua or UNSET,
        )

    def changed(self) -> None:
        """Publish the state if it has changed."""
        data = self.data()
        if data != self._published:
            self._published = data
            self._hub.broadcast(make_event(CHANGED, data))
        for notify in self.on_change:
            notify()

    def _program_changed(self) -> None:
        execution = self._execution
        if execution.state is self._last_program_state:
            return
        self._last_program_state = execution.state
        run = self._runs.get(execution.program.number)
        outcome = RunEnd.LOST if run is None else run.end
        self._states.program_changed(execution.state, outcome)
        if self.state is not MachineState.HOLDING and self.state is not MachineState.HELD:
            self._held_by_plc = False
        end = _JOB_ENDS.get(self.state)
        if self.job and end is not None:
            lost = end is JobEnd.FAILED and outcome is RunEnd.LOST
            self.job = 0
            for notify in self.on_job_end:
                notify(JobEnd.LOST if lost else end)
        self.changed()

    # -------------------------------------------------------------------------------- settings
    async def set_mode(self, mode: CellMode, by: str) -> None:
        """Change the mode.

        Raises:
            RequestRefused: a program is active.
            StorageError: the mode cannot be stored.
        """
        self._execution.require_no_program()
        await self._file.put(mode=mode)
        log.warning("mode of the cell", mode=mode.value, by=by)
        self.changed()

    async def set_authority(self, authority: CellAuthority, by: str) -> None:
        """Give the authority to the hub, the PLC or nobody. A running program continues.

        Raises:
            RequestRefused: the PLC cannot have the authority now.
            StorageError: the authority cannot be stored.
        """
        if authority is CellAuthority.PLC and self.authority is not CellAuthority.PLC:
            if self.link() is None and not self.has_opcua:
                raise RequestRefused("The server has no connection for a PLC. Start it with --plc-modbus or --opcua.")
            self._execution.require_no_program()
            if self._online.state.value != "stopped":
                raise RequestRefused("The scene is online and uses the devices. Stop the scene first.")
        await self._file.put(authority=authority)
        self._held_by_plc = False
        log.warning("authority over the cell", authority=authority.value, by=by)
        self.changed()

    async def set_jobs(self, jobs: list[CellJob], by: str) -> None:
        """Replace the jobs of the PLC.

        Raises:
            Conflict: two jobs have the same number.
            StorageError: the jobs cannot be stored.
        """
        by_number = {job.number: job for job in jobs}
        if len(by_number) < len(jobs):
            twice = sorted(number for number in by_number if sum(job.number == number for job in jobs) > 1)
            raise Conflict("Several jobs have the number {number}.", number=twice[0])
        await self._file.put(jobs=[by_number[number] for number in sorted(by_number)])
        log.info("jobs of the PLC", count=len(jobs), by=by)
        self.changed()

    # -------------------------------------------------------------------------------- rules
    def require_mode(self) -> None:
        """Raise RequestRefused unless the mode lets the PLC start programs."""
        if self.mode is not UnitMode.PRODUCE:
            raise RequestRefused(
                "The cell is in the mode {mode}. The PLC starts programs only in the mode produce.",
                mode=Message.of(_MODES[self._file.record.mode]),
            )

    def _check_run(self, how: RunStart) -> None:
        if how.by_plc:
            if self.authority is not CellAuthority.PLC:
                raise RequestRefused("The PLC does not have the authority over the cell.")
            self.require_mode()
            return
        match self.authority:
            case CellAuthority.PLC:
                raise RequestRefused(_PLC_HAS_AUTHORITY)
            case CellAuthority.NOBODY:
                raise RequestRefused(
                    "Nobody has the authority over the cell, for example because the server restarted while the PLC "
                    "had it. A technician gives it to the server or to the PLC first."
                )
        if self.mode is UnitMode.MANUAL:
            raise RequestRefused("The cell is in the mode manual, in which no program starts. Change the mode first.")
        if self.mode is UnitMode.MAINTENANCE and how.role < Role.TECHNICIAN:
            raise RequestRefused("The cell is in the mode maintenance, in which only technicians start programs.")

    def _check_resume(self) -> None:
        if self._held_by_plc:
            raise RequestRefused(
                "The PLC holds the program and resumes it. To resume it here, take the authority back first."
            )

    def _check_online(self) -> None:
        if self.authority is CellAuthority.PLC:
            raise RequestRefused(_PLC_HAS_AUTHORITY)

    # -------------------------------------------------------------------------------- commands of the PLC
    def require(self, command: MachineCommand) -> None:
        """Raise RequestRefused unless PackML allows a command in the present state."""
        self._states.require(command)

    @contextlib.contextmanager
    def starting(self, job: int) -> Iterator[None]:
        """Mark the program started in this context as a job of the PLC, unless the start fails."""
        self.job = job
        try:
            yield
        except BaseException:
            self.job = 0
            raise

    def hold(self, *, by_plc: bool) -> None:
        """Pause the program before its next action.

        Args:
            by_plc: whether the PLC requests it, so that it has to resume the program.

        Raises:
            RequestRefused: no program is running.
        """
        self._held_by_plc = by_plc
        try:
            self._execution.pause()
        except BaseException:
            self._held_by_plc = False
            raise

    def unhold(self) -> None:
        """Resume the program. Raise RequestRefused if that is not possible."""
        held, self._held_by_plc = self._held_by_plc, False
        try:
            self._execution.resume()
        except BaseException:
            self._held_by_plc = held
            raise

    async def end(self, command: MachineCommand, by: str) -> None:
        """Execute the command Reset, Clear, Stop or Abort.

        Args:
            command: the command.
            by: name of the PLC.

        Raises:
            RequestRefused: the present state does not allow it.
        """
        execution = self._execution
        self._states.command(command, active=execution.active)
        self.changed()
        if command is MachineCommand.STOP and execution.running:
            execution.stop(by)
        elif command is MachineCommand.ABORT or (command is MachineCommand.STOP and execution.active):
            await self._stop_all.stop_all(by)
