"""The files of a running server as a crash would leave them."""

import shutil
import time
from pathlib import Path


def copy_at_one_moment(source: Path, target: Path) -> None:
    """Copy files while nothing is written to them: after an acknowledgement the journal's thread may still write."""
    while True:
        before = _written(source)
        if before[1] < time.time() - 0.02:  # the resolution of a file system's times is a few milliseconds
            shutil.copytree(source, target)
            if _written(source) == before:
                return
            shutil.rmtree(target)
        time.sleep(0.005)


def _written(directory: Path) -> tuple[list[tuple[str, int, int]], float]:
    """Return the files with sizes and times, and the time of the last write, s."""
    stats = [(file.name, file.stat()) for file in sorted(directory.rglob("*")) if file.is_file()]
    return [(name, s.st_size, s.st_mtime_ns) for name, s in stats], max(s.st_mtime for _, s in stats)
