"""Processor time of a process that receives 30 frames of colour and depth per second."""

import asyncio
import sys
from pathlib import Path

import msgspec

from arcor2_server.demo.processes import Child, python_module
from benchmarks.metrics import Metric, Report

SECONDS = 20.0


async def run(report: Report, directory: Path) -> None:
    """Measure receiving 1280 x 720 colour and depth from the fake in a separate process, as in the cell host."""
    command = python_module("arcor2_fakes.oak_d", "--listen", "127.0.0.1:0", "--control", "127.0.0.1:0")
    fake = Child("camera", command, directory / "camera.log")
    try:
        addresses = await fake.start_json()
        receiver = (sys.executable, "-m", "benchmarks.receive_pictures", addresses["stream"], str(SECONDS))
        process = await asyncio.create_subprocess_exec(*receiver, stdout=asyncio.subprocess.PIPE)
        assert process.stdout is not None
        result = msgspec.json.decode(await process.stdout.read())
        await process.wait()
    finally:
        await fake.stop()
    seconds = result["seconds"]
    note = f"{result['frames'] / seconds:.1f} frames/s, age of a picture on arrival {result['age'] * 1e3:.1f} ms"
    report.add(Metric("oak_core_percent", 100.0 * result["cpu"] / seconds, result["frames"], note))
