"""Analysis time of eleven object types: five stock types, and six written for ARCOR2.

Each sample runs in a new process that has imported the analysis and not used it yet.
"""

import asyncio
import sys
from pathlib import Path
from typing import Final

import msgspec

from benchmarks.metrics import Metric, Report, median

SAMPLES: Final = 9
OLDER: Final = Path(__file__).resolve().parents[1] / "tests" / "runtime" / "older_sources.py"
_READ: Final = """
import runpy, sys, time
from arcor2_hw.analysis import Library, SourceFile, installed_types, module_name

older = runpy.run_path(sys.argv[1])["SOURCES"]
files = [each.file for each in installed_types() if each.file and each.distribution == "arcor2-hw"]
files = [file for file in files if file.module.startswith("arcor2_hw.objects.stock.")]
files += [SourceFile(name, module_name(name), source) for name, source in older.items()]
assert len(files) == 11, len(files)
began, used = time.perf_counter(), time.process_time()
library = Library(files)
found = [library.analyse(name) for name in library.names()]
wall, cpu = time.perf_counter() - began, time.process_time() - used
assert all(each.problem is None for each in found)
print(f"[{wall * 1000}, {cpu * 1000}]")
"""


async def analyse(report: Report) -> None:
    """Report the median wall time; the note shows the processor time."""
    samples: list[tuple[float, float]] = []
    for _ in range(SAMPLES):
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-c", _READ, str(OLDER), stdout=asyncio.subprocess.PIPE
        )
        output, _ = await process.communicate()
        samples.append(msgspec.json.decode(output, type=tuple[float, float]))
    cpu = median([each[1] for each in samples])
    note = f"{cpu:.1f} ms of it on a core; fastest {min(each[0] for each in samples):.1f} ms"
    report.add(Metric("analyse_11_ms", median([each[0] for each in samples]), SAMPLES, note))
