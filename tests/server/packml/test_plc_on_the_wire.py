"""A PLC (pymodbus) at the Modbus block of a running server, with programs in a real cell host."""

import asyncio
import contextlib
import socket
import struct
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

from pymodbus.client import AsyncModbusTcpClient

from arcor2_hw.data.packml import MachineCommand as C, MachineState as S
from arcor2_server.packml.plc import Holding, Input, Status
from arcor2_server.packml.record import JobEnd, RequestResult as R
from tests.runtime.conftest import Package, scene_object
from tests.server.cell.test_execution import LAMP, OBJ, PROJECT
from tests.server.core.serving import RawConnection, running, talking

WITHIN = 40.0
LIFE_TIMEOUT = "3"
ENDLESS, SHORT, FAILING, JAMMED, MISSING, UNKNOWN = 1, 2, 3, 4, 8, 9
JAM = """
    @action
    def jam(self, *, an: str | None = None) -> None:
        raise Refused("{name} is jammed", name=self.name)
"""
BODIES = {
    ENDLESS: 'while True:\n    lamp.blink(1, an="a")\n    time.sleep(0.02)',
    SHORT: 'lamp.blink(1, an="a")',
    FAILING: 'raise ValueError("broken")',
    JAMMED: 'lamp.jam(an="a")',
}
JOBS = [{"number": number, "package_id": f"pkg_{number}"} for number in (*BODIES, MISSING)]


def write_packages(data_dir: Path) -> None:
    """Write a package for each job. Its program first adds a line to the file `starts`."""
    for number, body in BODIES.items():
        start = (
            f'lamp = res.objects["{OBJ}"]\nimport time\nopen({str(data_dir / "starts")!r}, "a").write("{number}\\n")\n'
        )
        package = Package(data_dir / "packages" / f"pkg_{number}")
        package.write({"Lamp": LAMP + JAM}, [scene_object("lamp", "Lamp")], PROJECT, start + body)


def starts(data_dir: Path) -> list[str]:
    file = data_dir / "starts"
    return file.read_text().split() if file.exists() else []


class Master:
    """A PLC that cyclically writes its registers with a life counter, and reads the registers of the cell."""

    def __init__(self, host: str, port: int, request: int = 0) -> None:
        self.address = host, port
        self.request = request
        self.registers = [0, 0, 0, request]
        self.counting = True
        self.inputs: list[int] = []
        self._client = AsyncModbusTcpClient(host, port=port, retries=0)
        self._wake = asyncio.Event()

    async def run(self) -> None:
        assert await self._client.connect()
        try:
            while True:
                if self.counting:
                    self.registers[Holding.LIFE] = (self.registers[Holding.LIFE] + 1) & 0xFFFF
                written = await self._client.write_registers(0, self.registers)
                assert not written.isError(), written
                read = await self._client.read_input_registers(0, count=len(Input))
                self.inputs = read.registers
                self._wake.set()
                await asyncio.sleep(0.05)
        finally:
            self._client.close()

    def __getitem__(self, each: Input) -> int:
        return self.inputs[each]

    def has(self, bit: Status) -> bool:
        return bool(self[Input.STATUS] & bit)

    async def until(self, condition: Callable[[], bool]) -> None:
        async with asyncio.timeout(WITHIN):
            while True:
                self._wake.clear()
                await self._wake.wait()
                if condition():
                    return

    async def until_state(self, state: S) -> None:
        await self.until(lambda: self[Input.STATE] == state)

    async def command(self, command: int, job: int = 0) -> R:
        """Send a request and return its result."""
        self.request += 1
        self.registers[Holding.COMMAND :] = [command, job, self.request]
        await self.until(lambda: self[Input.REQUEST] == self.request)
        return R(self[Input.RESULT])

    async def make_idle(self) -> None:
        if self[Input.STATE] == S.ABORTED:
            assert await self.command(C.CLEAR) is R.ACCEPTED
        if self[Input.STATE] != S.IDLE:
            assert await self.command(C.RESET) is R.ACCEPTED
        await self.until(lambda: self.has(Status.READY))


@contextlib.asynccontextmanager
async def plc_of(client: RawConnection, request: int = 0) -> AsyncIterator[Master]:
    cell = await client.granted("GetCell")
    host, _, port = cell["plc"]["listening"].rpartition(":")
    master = Master(host, int(port), request)
    cycle = asyncio.create_task(master.run())
    try:
        await master.until(lambda: True)
        yield master
    finally:
        cycle.cancel()
        await asyncio.gather(cycle, return_exceptions=True)


@contextlib.asynccontextmanager
async def cell(data_dir: Path) -> AsyncIterator[RawConnection]:
    if not (data_dir / "packages").exists():
        write_packages(data_dir)
    arguments = ("--plc-modbus", "127.0.0.1:0")
    async with (
        running(data_dir, *arguments, ARCOR2_HW_PLC_LIFE_TIMEOUT=LIFE_TIMEOUT) as server,
        talking(server.url, "technician") as client,
    ):
        yield client


async def alarms(client: RawConnection) -> dict[str, Any]:
    found = await client.granted("ListAlarms", {"show": "all"})
    return {each["code"]: each for each in found["alarms"]}


def modbus_write(transaction: int, registers: list[int]) -> bytes:
    pdu = struct.pack(">BHHB4H", 16, 0, 4, 8, *registers)
    return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, 1) + pdu


async def test_a_plc_starts_jobs_once_and_a_technician_sets_the_authority(tmp_path: Path) -> None:
    data = tmp_path / "data"
    async with cell(data) as client, plc_of(client) as plc:
        # Without the authority, the PLC starts nothing.
        assert (plc[Input.VERSION], plc[Input.STATE], plc[Input.MODE], plc[Input.AUTHORITY]) == (1, S.STOPPED, 1, 1)
        assert await plc.command(C.RESET) is R.NO_AUTHORITY
        await client.granted("SetCellJobs", {"jobs": JOBS})
        given = await client.granted("SetCellAuthority", {"authority": "plc"})
        assert (given["authority"], given["plc"]["peer"], given["plc"]["alive"]) == ("plc", "127.0.0.1", True)
        assert "The PLC has the authority" in await client.refused("RunPackage", {"id": "pkg_2"})

        # A job from start to end.
        assert await plc.command(C.START, SHORT) is R.WRONG_STATE
        await plc.make_idle()
        assert await plc.command(C.START, SHORT) is R.ACCEPTED
        await plc.until(lambda: plc.has(Status.DONE))
        assert (plc[Input.STATE], plc[Input.JOB], plc[Input.JOB_END]) == (S.COMPLETE, SHORT, JobEnd.COMPLETED)
        assert not plc.has(Status.BUSY)
        assert plc[Input.COMPLETED] == 1

        # Jobs that do not exist, a command that does not exist, and a job that fails.
        await plc.make_idle()
        assert await plc.command(C.START, UNKNOWN) is R.UNKNOWN_JOB
        assert await plc.command(C.START, MISSING) is R.UNKNOWN_JOB
        assert await plc.command(77) is R.UNKNOWN_COMMAND
        raised = (await alarms(client))["plc_job_unknown"]
        assert "127.0.0.1" in raised["text"]
        assert await plc.command(C.START, FAILING) is R.ACCEPTED
        await plc.until_state(S.ABORTED)
        assert plc.has(Status.ERROR)
        assert plc[Input.JOB_END] == JobEnd.FAILED
        assert starts(data) == [str(SHORT), str(FAILING)]

        # An action that fails holds the job until a person has decided.
        await plc.make_idle()
        assert await plc.command(C.START, JAMMED) is R.ACCEPTED
        await plc.until(lambda: plc.has(Status.HELD) and plc.has(Status.PERSON_NEEDED))
        assert await plc.command(C.UNHOLD) is R.PERSON_NEEDED
        held = (await client.granted("GetHeld"))["held"]
        await client.granted("DecideHeld", {"number": held["number"], "choice": "skip"})
        await plc.until(lambda: plc.has(Status.DONE))

        # A client stops a job of the PLC, and the PLC aborts one.
        await plc.make_idle()
        assert await plc.command(C.START, ENDLESS) is R.ACCEPTED
        await plc.until_state(S.EXECUTE)
        await client.granted("StopPackage")
        await plc.until_state(S.STOPPED)
        assert plc[Input.JOB_END] == JobEnd.STOPPED
        await plc.make_idle()
        assert await plc.command(C.START, ENDLESS) is R.ACCEPTED
        await plc.until_state(S.EXECUTE)
        assert await plc.command(C.ABORT) is R.ACCEPTED
        await plc.until_state(S.ABORTED)
        assert plc.has(Status.ERROR)

        # Stop by the PLC, also after the authority was taken back.
        await plc.make_idle()
        assert await plc.command(C.START, ENDLESS) is R.ACCEPTED
        await plc.until_state(S.EXECUTE)
        assert plc.has(Status.BUSY)
        assert await plc.command(C.HOLD) is R.ACCEPTED
        await plc.until_state(S.HELD)
        assert "The PLC holds the program" in await client.refused("ResumePackage")
        await client.granted("SetCellAuthority", {"authority": "hub"})
        await client.granted("ResumePackage")
        await plc.until_state(S.EXECUTE)
        assert await plc.command(C.STOP) is R.ACCEPTED
        await plc.until_state(S.STOPPED)
        assert plc[Input.JOB_END] == JobEnd.STOPPED

        # Modes.
        await client.granted("SetCellMode", {"mode": "manual"})
        assert "in the mode manual" in await client.refused("RunPackage", {"id": "pkg_2"})
        await client.granted("SetCellMode", {"mode": "changeover"})
        await client.granted("SetCellAuthority", {"authority": "plc"})
        assert await plc.command(C.RESET) is R.ACCEPTED
        assert await plc.command(C.START, SHORT) is R.WRONG_MODE
        assert plc[Input.MODE] == 4
        await client.granted("SetCellAuthority", {"authority": "hub"})
        await client.granted("RunPackage", {"id": "pkg_2"})
        await plc.until_state(S.COMPLETE)
        assert starts(data) == [str(each) for each in (SHORT, FAILING, JAMMED, *[ENDLESS] * 3, SHORT)]


async def test_a_job_starts_once_despite_a_lost_answer_a_frozen_life_counter_and_a_restart(tmp_path: Path) -> None:
    data = tmp_path / "data"
    async with cell(data) as client:
        await client.granted("SetCellJobs", {"jobs": JOBS})
        async with plc_of(client) as plc:
            await client.granted("SetCellAuthority", {"authority": "plc"})
            await plc.make_idle()
            address, request, life = plc.address, plc.request + 1, plc.registers[Holding.LIFE]
        frame = modbus_write(1, [life + 1, C.START, ENDLESS, request])
        with socket.create_connection(address, WITHIN) as dropped:
            dropped.sendall(frame)
            async with plc_of(client, request) as plc:  # it sends the same request number again, cyclically
                await plc.until(lambda: plc[Input.REQUEST] == request)
                dropped.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                dropped.close()  # the answer was not read: the connection is reset
                plc.registers[1:3] = [C.START, ENDLESS]
                await plc.until_state(S.EXECUTE)
                assert plc[Input.RESULT] == R.ACCEPTED
                assert (await client.granted("GetCell"))["job"] == ENDLESS
                assert starts(data) == [str(ENDLESS)]

                # A frozen life counter, also while the connection is used.
                plc.counting = False
                await plc.until_state(S.HELD)
                assert plc.has(Status.PLC_SILENT)
                raised = (await alarms(client))["plc_silent"]
                assert raised["active"]
                assert "The life counter of the PLC at 127.0.0.1" in raised["text"]
                assert await plc.command(C.UNHOLD) is R.LIFE_COUNTER_FROZEN
                await client.granted("ResumePackage")  # a person resumes; it is not held again
                await plc.until_state(S.EXECUTE)
                plc.counting = True
                await plc.until(lambda: not plc.has(Status.PLC_SILENT))
                assert not (await alarms(client))["plc_silent"]["active"]
                plc.counting = False
                await plc.until_state(S.HELD)
                plc.counting = True
                await plc.until(lambda: not plc.has(Status.PLC_SILENT))
                assert plc[Input.STATE] == S.HELD  # nothing continues by itself
                assert await plc.command(C.UNHOLD) is R.ACCEPTED
                await plc.until_state(S.EXECUTE)
                request = plc.request
        refused = (await alarms(client))["plc_request_refused"]["count"]

    # The server has ended during the job, and starts again while the PLC repeats its last request.
    async with cell(data) as client, plc_of(client, request) as plc:
        assert (plc[Input.STATE], plc[Input.AUTHORITY], plc[Input.REQUEST]) == (S.STOPPED, 0, request)
        assert (plc[Input.JOB], plc[Input.JOB_END]) == (ENDLESS, JobEnd.LOST)
        assert plc.has(Status.ERROR)
        assert "Nobody has the authority" in await client.refused("RunPackage", {"id": "pkg_2"})
        await client.granted("SetCellAuthority", {"authority": "plc"})
        plc.registers[1:3] = [C.START, SHORT]  # still with the old request number
        await plc.make_idle()
        assert starts(data) == [str(ENDLESS)]
        assert (await alarms(client))["plc_request_refused"][
            "count"
        ] == refused  # the repeated request is not refused either
