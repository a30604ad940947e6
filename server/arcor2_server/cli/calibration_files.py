"""Input files, progress and output of the calibration commands."""

import math
import sys
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, TypeVar

import msgspec
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn
from rich.table import Table

from arcor2_hw.calibration.configuration import yaml_of
from arcor2_hw.calibration.refusals import CalibrationRefused
from arcor2_hw.compute.task import MAX_PICTURE, Task
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.server_connection import Failed, run
from arcor2_server.compute.process import ProgressCallback
from arcor2_server.compute.workers import Compute
from arcor2_server.log import setup as server_logging

T = TypeVar("T")
R = TypeVar("R")
MAX_FILE: Final = 1 << 20
"""Maximum size of a YAML or JSON file, bytes."""


# ------------------------------------------------------------------------------------------------ files
def content_of(path: Path, largest: int) -> bytes:
    """Return the content of a file. Raise NotFound or InvalidData if it cannot be read."""
    try:
        if path.stat().st_size > largest:
            raise InvalidData("{path} is larger than {largest} bytes.", path=path, largest=largest)
        return path.read_bytes()
    except FileNotFoundError:
        raise NotFound("File {path} does not exist.", path=path) from None
    except OSError as error:
        raise InvalidData("{path} cannot be read: {reason}.", path=path, reason=error.strerror) from None


def picture_of(path: Path) -> bytes:
    """Return the content of a picture file. Raise NotFound or InvalidData if it cannot be read."""
    return content_of(path, MAX_PICTURE)


def read_as(path: Path, kind: type[T]) -> T:
    """Read a YAML or JSON file as a type. Raise NotFound or InvalidData if it cannot be read."""
    content = yaml_of(content_of(path, MAX_FILE), str(path))
    try:
        return msgspec.convert(content, kind)
    except (msgspec.ValidationError, ValueError) as error:
        raise InvalidData("{path}: {reason}.", path=path, reason=error) from None


def write(path: Path, content: bytes) -> None:
    """Write a file and create its folders. Raise InvalidData if it cannot be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    except OSError as error:
        raise InvalidData("{path} cannot be written: {reason}.", path=path, reason=error.strerror) from None
    Console(stderr=True, highlight=False).print(f"Written: {path}")


# ------------------------------------------------------------------------------------------------ computing
def calibrated(command: str, work: Callable[[], Awaitable[Any]]) -> int:
    """Run a command. The exit status of a refused calibration is CALIBRATION_REFUSED."""

    async def working() -> Any:
        try:
            return await work()
        except CalibrationRefused as error:
            detail = f" ({error.detail})" if error.detail else ""
            raise Failed(ExitStatus.CALIBRATION_REFUSED, f"{error}{detail}") from error

    return run(f"calibrate {command}", working)


async def compute(task: Task[R]) -> R:
    """Return the result of a task. It runs in a worker process, and its progress is shown."""
    server_logging.set_up("error")
    worker = Compute(idle=60.0)
    try:
        with progress(task.label.text) as on_progress:
            return await worker.run(task, on_progress=on_progress)
    finally:
        await worker.close()


@contextmanager
def progress(label: str) -> Iterator[ProgressCallback]:
    """Show a progress bar on standard error if it is a terminal."""
    console = Console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as shown:
        bar = shown.add_task(label, total=1.0)

        def on_progress(share: float, message: str) -> None:
            shown.update(bar, completed=share, description=message or label)

        yield on_progress


# ------------------------------------------------------------------------------------------------ showing
def show_json(result: Any) -> None:
    """Print a result as JSON."""
    sys.stdout.write(msgspec.json.format(msgspec.json.encode(result)).decode() + "\n")


def pose_table(label: str, pose: Pose) -> Table:
    """Return a table with the position, the rotation angles and the quaternion of a pose."""
    table = Table(label, "", box=None, pad_edge=False, show_header=True)
    x, y, z = (f"{1e3 * value:.2f}" for value in pose.position)
    table.add_row("position", f"x {x} mm   y {y} mm   z {z} mm")
    roll, pitch, yaw = (f"{math.degrees(value):.2f}" for value in angles(pose))
    table.add_row("rotation", f"about x {roll}°   then about y {pitch}°   then about z {yaw}° (fixed axes)")
    table.add_row("quaternion", "   ".join(f"{n} {v:.6f}" for n, v in zip("xyzw", pose.orientation, strict=True)))
    return table


def angles(pose: Pose) -> tuple[float, float, float]:
    """Return the rotation angles about the fixed axes x, then y, then z, rad."""
    x, y, z, w = pose.orientation
    pitch = math.asin(min(max(2 * (w * y - z * x), -1.0), 1.0))
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    return roll, pitch, math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
