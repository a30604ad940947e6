"""Looks at each device of a cell.yaml: connects, reads, disconnects. A process of its own, as a cell host is.

`python -m arcor2_hw.runtime.checking cell.yaml [NAME ...]` prints one Checked as JSON a line, in the order of the ends.
Only what observes is called; control is never taken.
"""

import argparse
import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeVar

import msgspec

from arcor2_hw.data.base import Unset
from arcor2_hw.data.cell import CellDevice, parameters_of, read_cell
from arcor2_hw.data.device import Alarm, Connection, Health
from arcor2_hw.data.discovery import Checked
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error, Arcor2NotImplemented
from arcor2_hw.runtime.creation import find_type, recipe
from arcor2_hw.runtime.device import CLOSE_DEADLINE, Device, describe
from arcor2_hw.runtime.lane import Job

ASKED_WITHIN: Final = 3.0
"""Seconds for each question to a device that is connected."""
BAD_FILE: Final = 2
T = TypeVar("T")


def check(given: CellDevice) -> Checked:
    """Connect a device, read it, disconnect it. Whatever goes wrong is told in the result."""
    nothing = Checked(given.name, given.type)
    try:
        cls = find_type(given.type)
        pose = Pose() if isinstance(given.pose, Unset) else given.pose
        scene_object = SceneObject(given.name, given.type, pose, parameters_of(given), f"obj_{given.name}")
        device = Device(recipe(scene_object, cls, None))
    except Arcor2Error as error:
        return msgspec.structs.replace(nothing, problem=str(error))
    found = msgspec.structs.replace(nothing, address=device.recipe.address)
    began = time.monotonic()
    try:
        opening, deadline = device.open(lambda _: None)
        if not opening.wait(deadline):
            device.lane.expire(opening, deadline)
        found = msgspec.structs.replace(found, seconds=time.monotonic() - began)
        if opening.error is not None:
            return msgspec.structs.replace(found, problem=_with_detail(device, opening.error))
        return _read(device, found)
    except Arcor2Error as error:
        return msgspec.structs.replace(found, problem=_with_detail(device, error))
    finally:
        _close(device)


def _with_detail(device: Device, error: BaseException) -> str:
    """Give an error with its detail, where that adds something."""
    named = describe(device, error)
    return f"{named} ({named.detail})" if named.detail and named.detail not in str(named) else str(named)


def _read(device: Device, found: Checked) -> Checked:
    instance = device.require()
    problem = ""

    def ask(what: str, question: Callable[[], T], otherwise: T) -> T:
        nonlocal problem
        job = Job(what, question)
        device.lane.submit(job)
        if not job.wait(ASKED_WITHIN):
            device.lane.expire(job, ASKED_WITHIN)
        if job.error is None:
            answer: T = job.value
            return answer
        if not isinstance(job.error, Arcor2NotImplemented):
            problem = problem or _with_detail(device, job.error)
        return otherwise

    identity = ask("identify", instance.identify, None)
    alarms = ask("alarms", instance.alarms, list[Alarm]())
    owner = ask("control_owner", instance.control_owner, None)
    health = ask("health", lambda: instance.health, Health.FAILURE)
    connection = ask("connection", lambda: instance.connection, Connection.FAILED)
    return msgspec.structs.replace(
        found,
        identity=identity,
        alarms=alarms,
        control_owner=owner,
        health=health,
        connection=connection,
        problem=problem,
    )


def _close(device: Device) -> None:
    with contextlib.suppress(Arcor2Error):
        closing = device.begin_close()
        if closing is not None:
            closing.wait(CLOSE_DEADLINE)
    device.release_lanes()


def main() -> None:
    """Check the devices of a file, or those named, all at once."""
    parser = argparse.ArgumentParser(description="Looks at the devices of a cell.yaml.")
    parser.add_argument("file", type=Path)
    parser.add_argument("names", nargs="*", help="only these")
    options = parser.parse_args()
    # What a vendor's library prints must not get between the lines of the result.
    results = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    try:
        cell = read_cell(options.file)
    except Arcor2Error as error:
        sys.stderr.write(f"{error}\n")
        os._exit(BAD_FILE)
    one = threading.Lock()

    def work(given: CellDevice) -> None:
        found: Any = check(given)
        with one:
            results.write(msgspec.json.encode(found) + b"\n")
            results.flush()

    chosen = [device for device in cell.devices if not options.names or device.name in options.names]
    threads = [threading.Thread(target=work, args=(device,), name=f"check {device.name}") for device in chosen]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    os._exit(0)  # whatever a library has left running


if __name__ == "__main__":
    main()
