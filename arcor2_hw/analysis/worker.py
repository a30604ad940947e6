"""Analysis of a library in a separate process, because parsing one huge source holds the interpreter lock for seconds.

`python -m arcor2_hw.analysis.worker` reads the sources from standard input and writes the results to standard output.
"""

import asyncio
import sys
from typing import Final

import msgspec

from arcor2_hw.analysis.library import BUILT_IN, Library
from arcor2_hw.analysis.snapshot import StoredSource, take
from arcor2_hw.analysis.source import Problem, SourceFile
from arcor2_hw.analysis.type_analysis import TypeAnalysis
from arcor2_hw.data.object_type import ObjectTypeMeta
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message

SEPARATE_PROCESS_SIZE: Final = 64 * 1024
"""Number of characters above which a source is analysed in a separate process; a shorter one is parsed in about 20 ms.
"""
TIME_LIMIT: Final = 30.0
"""Time limit of the analysis of all sources, s."""
_encode = msgspec.msgpack.Encoder().encode


def _huge(library: Library) -> list[str]:
    return [
        name
        for name in library.names()
        if name not in BUILT_IN and _longest(library.file(name)) > SEPARATE_PROCESS_SIZE
    ]


def _longest(file: SourceFile) -> int:
    return max(len(each.source) for each in (file, *file.modules))


def is_needed(library: Library) -> bool:
    """Return whether a library has a source that is too long to be parsed in the process of the server."""
    return bool(_huge(library))


def disable_huge_types(library: Library, reason: Message) -> None:
    """Disable the types of huge sources after their analysis failed."""
    metas = [ObjectTypeMeta(name, abstract=True).disabled_because(reason) for name in _huge(library)]
    library.put_analyses({meta.type: TypeAnalysis(meta, problem=Problem(reason, meta.type, 1)) for meta in metas}, {})


async def analyse(library: Library) -> bytes:
    """Analyse all types of a library in another process, and return the results encoded for `snapshot.restore`.

    Raises:
        InvalidData: The process failed, or exceeded `TIME_LIMIT` and was ended.
    """
    sources = [StoredSource.of(library.file(name)) for name in library.names() if name not in BUILT_IN]
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-P", "-m", __name__),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    try:
        async with asyncio.timeout(TIME_LIMIT):
            encoded, errors = await process.communicate(_encode(sources))
    except TimeoutError:
        raise InvalidData("The sources were not analysed within {within:g} s.", within=TIME_LIMIT) from None
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    if process.returncode != 0:
        raise InvalidData("The analysis of the sources failed.", errors.decode(errors="replace")[-2000:])
    return encoded


def main() -> None:
    """Analyse the sources on standard input."""
    sources = msgspec.msgpack.decode(sys.stdin.buffer.read(), type=list[StoredSource])
    sys.stdout.buffer.write(take(Library(stored.file() for stored in sources)))


if __name__ == "__main__":
    main()
