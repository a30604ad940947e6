"""The main job as a newcomer runs it: three readings must agree, and each sabotage must change the outcome."""

import asyncio
import random
import re
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest
from pymodbus.client import AsyncModbusTcpClient

from arcor2_hw.client import Client
from arcor2_hw.data.base import Unset
from arcor2_server.demo.run import ask
from tests.e2e.harness import until

pytestmark = pytest.mark.timeout(240)


class Run:
    """One `arcor2-hw demo` process, its output and its addresses."""

    def __init__(self, process: asyncio.subprocess.Process, data_dir: Path) -> None:
        self.process = process
        self.data_dir = data_dir
        self.output = ""

    async def read(self) -> None:
        assert self.process.stdout is not None
        while chunk := await self.process.stdout.read(4096):
            self.output += chunk.decode()

    def at(self) -> dict[str, Any] | None:
        file = self.data_dir / "demo.json"
        return msgspec.json.decode(file.read_bytes()) if file.exists() else None

    async def tell(self, name: str, do: str, **arguments: Any) -> Any:
        at = self.at()
        assert at is not None
        host, _, port = at[name]["control"].rpartition(":")
        reader, writer = await asyncio.open_connection(host, int(port), limit=1 << 22)
        try:
            writer.write(msgspec.json.encode({"id": 1, "do": do, **arguments}) + b"\n")
            answer = msgspec.json.decode(await asyncio.wait_for(reader.readline(), 5))
        finally:
            writer.close()
        assert answer["ok"], answer
        return answer.get("data")


@asynccontextmanager
async def demo(tmp_path: Path, *arguments: str) -> AsyncIterator[Run]:
    command = [sys.executable, "-m", "arcor2_server.cli.main", "demo", "--port", "0", "--data-dir", str(tmp_path)]
    process = await asyncio.create_subprocess_exec(
        *command, *arguments, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT
    )
    run = Run(process, tmp_path)
    reading = asyncio.create_task(run.read())
    try:
        yield run
    finally:
        if process.returncode is None:
            process.send_signal(signal.SIGINT)
            try:
                await asyncio.wait_for(process.wait(), 15)
            except TimeoutError:
                process.kill()
                await process.wait()
        await reading


async def watch(url: str, results: list[bool]) -> None:
    """An observer that registers nobody and only listens: collects what the script found."""
    async with Client(url) as client:
        tests: set[str] = set()
        async for event in client.events():
            if event.event == "PackageInfo":
                points = event.data.project.action_points
                tests = {a.id for point in points for a in point.actions if a.outputs() == ["passed"]}
            elif event.event == "ActionStateAfter" and event.data.action_id in tests:
                assert not isinstance(event.data.results, Unset)
                results.append(event.data.results == ["true"])


async def test_three_readings_agree_and_ctrl_c_ends_everything(tmp_path: Path) -> None:
    seed = random.SystemRandom().randrange(1_000_000)
    print(f"seed {seed}")  # noqa: T201
    async with demo(tmp_path, "--boards", "3", "--seed", str(seed)) as run:
        at = await until(run.at, "the demo to say where everything is", 40)
        script: list[bool] = []
        observer = asyncio.create_task(watch(at["url"], script))
        await until(lambda: "serving at" in run.output or run.process.returncode is not None, "the cycle to end", 200)
        assert f"seed {seed}" in run.output
        found = re.search(r"cycle complete: (\d+) boards, (\d+) passed, (\d+) failed, ([\d.]+) s", run.output)
        assert found, run.output
        boards, passed, failed = (int(number) for number in found.groups()[:3])

        host, _, port = at["tester"]["modbus"].rpartition(":")
        tester = AsyncModbusTcpClient(host, port=int(port))
        await tester.connect()
        counters = (await tester.read_input_registers(12, count=3, device_id=1)).registers
        tester.close()

        truth = await ask(at["world"]["control"], "truth")
        where = [(board["good"], board["place"]) for board in truth["boards"]]

        assert boards == 3
        assert (script.count(True), script.count(False)) == (passed, failed)
        assert counters == [boards, passed, failed]
        assert sorted(where) == sorted([(True, "good")] * passed + [(False, "bad")] * failed)

        run.process.send_signal(signal.SIGINT)
        assert await asyncio.wait_for(run.process.wait(), 10) == 0, run.output
        await asyncio.wait_for(observer, 5)  # its events end with the server


async def test_once_ends_by_itself_with_status_0(tmp_path: Path) -> None:
    async with demo(tmp_path, "--once", "--boards", "2", "--seed", "1") as run:
        assert await asyncio.wait_for(run.process.wait(), 200) == 0, run.output
        assert "cycle complete: 2 boards" in run.output


@pytest.mark.parametrize(
    ("fake", "do", "arguments", "told"),
    [
        ("world", "gripper", {"works": False}, "robot"),
        ("tester", "fault", {"code": 103}, "no contact"),
        ("reader", "silence", {}, "reader"),
    ],
    ids=["gripper off", "tester fault", "reader silent"],
)
async def test_sabotage_changes_the_outcome(
    tmp_path: Path, fake: str, do: str, arguments: dict[str, Any], told: str
) -> None:
    async with demo(tmp_path, "--once", "--boards", "2", "--seed", "1") as run:
        await until(run.at, "the demo to say where everything is", 40)
        if fake == "tester":
            await until(lambda: "  test" in run.output, "a test to begin", 120)
        await run.tell(fake, do, **arguments)
        assert await asyncio.wait_for(run.process.wait(), 200) != 0, run.output
        assert "cycle complete: 2 boards" not in run.output
        last = run.output.strip().splitlines()[-1]
        assert last.startswith("arcor2-hw demo: ")
        assert told in last, last
        truth_known = [line for line in run.output.splitlines() if "Traceback" in line]
        assert not truth_known, run.output
