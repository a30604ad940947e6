"""Declarations of alarms: `alarms.toml` next to the source of a driver."""

from collections import Counter
from collections.abc import Iterable, Iterator
from fnmatch import fnmatchcase
from functools import lru_cache
from pathlib import Path
from typing import Final

import msgspec
from msgspec.structs import replace

from arcor2_hw.analysis.templates import LIBRARY
from arcor2_hw.data.alarms import AlarmFile, AlarmKind
from arcor2_hw.exceptions import InvalidData

FILE: Final = "alarms.toml"
LANGUAGES: Final = ("cs", "de")
"""Languages into which our own drivers are translated."""


def read(folder: Path) -> list[AlarmKind]:
    """Return the alarms that a folder declares, with their groups; empty without a file.

    Raises:
        InvalidData: The file cannot be read, has unknown keys or invalid values, or declares a number or code twice.
    """
    file = folder / FILE
    try:
        content = msgspec.toml.decode(file.read_bytes(), type=AlarmFile)
    except FileNotFoundError:
        return []
    except (OSError, ValueError) as error:  # ValidationError, TOMLDecodeError and UnicodeDecodeError are ValueErrors
        raise InvalidData("{path}: {reason}.", path=file, reason=str(error).rstrip(".")) from error
    for what, values in (
        ("number", [each.number for each in content.alarm]),
        ("code", [e.code for e in content.alarm]),
    ):
        if twice := [value for value, count in Counter(values).items() if count > 1]:
            raise InvalidData(
                "{path} declares the {what} {value} twice.", path=file, what=what, value=min(twice, key=str)
            )
    for kind in content.alarm:
        if kind.picture and not _picture(folder, kind.picture).is_file():
            raise InvalidData(
                "{path}: alarm {number} has the picture {picture}, which is not an SVG file next to it.",
                path=file,
                number=kind.number,
                picture=kind.picture,
            )
    group = content.group or folder.name
    return [replace(kind, group=kind.group or group) for kind in content.alarm]


def _picture(folder: Path, name: str) -> Path:
    """Return the file of a picture; the folder itself for a name that is not that of an SVG file in it."""
    file = folder / name
    return file if file.suffix == ".svg" and folder in file.resolve().parents else folder


def kind_of(code: str, *declared: Iterable[AlarmKind]) -> AlarmKind | None:
    """Return the declaration of a code: exact matches before patterns, then earlier lists, then longer patterns."""
    found = [
        (kind.code == code, -rank, len(kind.code.replace("*", "")), kind)
        for rank, kinds in enumerate(declared)
        for kind in kinds
        if fnmatchcase(code, kind.code)
    ]
    return max(found, key=lambda each: each[:3])[3] if found else None


@lru_cache(maxsize=1)
def common() -> tuple[AlarmKind, ...]:
    """Return the alarms that every device has, such as a lost connection."""
    return tuple(read(LIBRARY))


def texts_of(kinds: Iterable[AlarmKind]) -> Iterator[str]:
    """Yield the texts of declarations that users see."""
    for kind in kinds:
        yield from (text for text in (kind.text, kind.cause, kind.remedy) if text)
