"""The process or the service is killed: every stored result arrives exactly once and in order."""

import random
import select
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from arcor2_drivers.erp.erp_service import ErpService
from tests.drivers.erp.conftest import serials
from tests.fakes.conftest import FakeProcess

REPORTING = """
import sys
from arcor2_drivers.erp.erp_service import ErpService
from arcor2_drivers.erp.settings import ErpSettings
url, outbox, first, count = sys.argv[1:]
erp = ErpService("id", "orphan", ErpSettings(url, outbox=outbox, request_timeout=10.0))
erp.connect()
for number in range(int(first), int(first) + int(count)):
    erp.report_result("A-1", f"S-{number}", True)
    print(number, flush=True)
sys.stdin.read()
"""


@pytest.fixture
def order(fake: FakeProcess) -> str:
    fake.control.do("add_order", order="A-1", product="PCB", quantity=1000)
    return "A-1"


@pytest.fixture
def reporting(tmp_path: Path) -> Any:
    """Return ``reporting(url, 0, 5)``: a process that reports, prints what it stored, and does not end."""
    processes: list[subprocess.Popen[str]] = []

    def start(url: str, first: int, count: int) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", REPORTING, url, str(tmp_path), str(first), str(count)]
        processes.append(subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True))
        return processes[-1]

    yield start
    for process in processes:
        process.kill()
        process.communicate()


def test_a_kill_between_sending_and_answer_duplicates_nothing(
    fake: FakeProcess, make: Callable[..., ErpService], order: str, reporting: Any
) -> None:
    process = reporting(fake.ready["url"], 1, 1)
    fake.control.wait_until(lambda t: t["results"], within=20.0)
    assert process.stdout.readline() == "1\n"
    process.kill()
    process.wait()
    fake.control.do("slow", seconds=3.0)  # connecting takes as long, too
    process = reporting(fake.ready["url"], 2, 1)
    fake.control.wait_until(lambda t: len(t["results"]) == 2, within=20.0)  # stored; the answer follows 3 s later
    process.kill()
    process.wait()
    fake.control.do("heal")
    repeated = fake.truth()["repeated"]  # the first process, too, may have been killed before it received an answer
    erp = make(fake.ready["url"])
    erp.connect()
    erp.wait_until_sent(5.0)
    assert serials(fake) == ["S-1", "S-2"]
    assert fake.truth()["repeated"] == repeated + 1, "the result was not sent again, so it was not killed in between"


def test_many_kills_lose_and_duplicate_nothing(
    fake: FakeProcess, make: Callable[..., ErpService], order: str, reporting: Any
) -> None:
    drawn = random.Random(7)
    stored: list[int] = []
    for life in range(4):
        process = reporting(fake.ready["url"], 100 * life, 100)
        until = None
        while until is None or time.monotonic() < until:
            readable, _, _ = select.select([process.stdout], [], [], 0.01)
            if readable:
                line = process.stdout.readline()
                if not line:
                    break
                stored.append(int(line))
                until = until or time.monotonic() + drawn.uniform(0.01, 0.15)
        process.kill()
        process.wait()
        stored += [int(line) for line in process.stdout.read().split("\n") if line.strip()]
    erp = make(fake.ready["url"])
    erp.connect()
    erp.wait_until_sent(20.0)
    arrived = [int(serial.removeprefix("S-")) for serial in serials(fake)]
    assert arrived == sorted(set(arrived)), "out of order, or twice"
    assert set(stored) <= set(arrived), "a stored result did not arrive"
    assert len(set(arrived) - set(stored)) <= 4, "each process may store one result that it did not print"


def test_a_restarted_service_loses_and_duplicates_nothing(
    start_fake: Callable[..., FakeProcess], make: Callable[..., ErpService], tmp_path: Path
) -> None:
    store = str(tmp_path / "plan.jsonl")
    first = start_fake("erp", "--store", store, "--order", "A-1=PCB:10")
    where = first.ready["url"].removeprefix("http://")
    erp = make(first.ready["url"])
    erp.connect()
    assert erp.next_order()[4] == 10
    erp.report_result("A-1", "S-0", True)
    erp.wait_until_sent(5.0)
    first.control.do("slow", seconds=30.0)
    erp.report_result("A-1", "S-1", True)
    first.control.wait_until(lambda t: len(t["results"]) == 2)  # stored, and its answer will never arrive
    first.process.kill()
    first.process.wait()
    erp.report_result("A-1", "S-2", False)
    second = start_fake("erp", "--store", store, "--listen", where)
    erp.wait_until_sent(20.0)
    assert serials(second) == ["S-0", "S-1", "S-2"]
    assert second.truth()["repeated"] >= 1
    assert erp.next_order()[4] == 7
