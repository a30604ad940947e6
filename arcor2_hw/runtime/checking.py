"""Check each device of a cell.yaml: connect, read, disconnect. Runs in its own process.

`python -m arcor2_hw.runtime.checking cell.yaml [NAME ...]` prints a line with one Checked in JSON per device. The
check only observes: it never takes control.
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

QUERY_TIMEOUT: Final = 3.0
"""Time limit of each query to a connected device, s."""
EXIT_BAD_FILE: Final = 2
"""Exit status if the file cannot be read."""
T = TypeVar("T")


def check(given: CellDevice) -> Checked:
    """Connect a device, read its state and disconnect it. The result contains any problem."""
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
    """Return the text of an error, with its detail unless the text contains it."""
    named = describe(device, error)
    return f"{named} ({named.detail})" if named.detail and named.detail not in str(named) else str(named)


def _read(device: Device, found: Checked) -> Checked:
    instance = device.require()
    problem = ""

    def query(query_name: str, function: Callable[[], T], otherwise: T) -> T:
        nonlocal problem
        job = Job(query_name, function)
        device.lane.submit(job)
        if not job.wait(QUERY_TIMEOUT):
            device.lane.expire(job, QUERY_TIMEOUT)
        if job.error is None:
            answer: T = job.value
            return answer
        if not isinstance(job.error, Arcor2NotImplemented):
            problem = problem or _with_detail(device, job.error)
        return otherwise

    identity = query("identify", instance.identify, None)
    alarms = query("alarms", instance.alarms, list[Alarm]())
    owner = query("control_owner", instance.control_owner, None)
    health = query("health", lambda: instance.health, Health.FAILURE)
    connection = query("connection", lambda: instance.connection, Connection.FAILED)
    return msgspec.structs.replace(
        found,
        identity=identity,
        alarms=alarms,
        control_owner=None if owner is None else str(owner),  # the text may be a Phrase, which cannot be encoded
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
    """Check all devices of a file, or only the named ones, concurrently."""
    parser = argparse.ArgumentParser(description="Check the devices of a cell.yaml.")
    parser.add_argument("file", type=Path)
    parser.add_argument("names", nargs="*", help="names of the devices to check, by default all")
    options = parser.parse_args()
    # Output of vendor libraries must not mix with the result.
    results = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    try:
        cell = read_cell(options.file)
    except Arcor2Error as error:
        sys.stderr.write(f"{error}\n")
        os._exit(EXIT_BAD_FILE)
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
    os._exit(0)  # even if a library still runs threads


if __name__ == "__main__":
    main()
