"""Translations of a driver: `translations/<language>.json` next to its source, by English text."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

import msgspec

from arcor2_hw.analysis.templates import fields_of
from arcor2_hw.analysis.type_analysis import TypeAnalysis
from arcor2_hw.data.base import Unset
from arcor2_hw.data.object_type import ObjectAction, ParameterMeta
from arcor2_hw.exceptions import InvalidData

FOLDER: Final = "translations"
MAX_SIZE: Final = 4 * 1024 * 1024
"""Maximum size of a file, bytes."""
GROUPED: Final = 3
"""Minimum number of settings with a common first word that the editor shows as a group with this title."""
_LANGUAGE: Final = re.compile(r"[a-z]{2,3}(-[A-Z]{2})?")


def is_language(name: str) -> bool:
    """Return whether a name is a language tag such as "cs" or "pt-BR"."""
    return _LANGUAGE.fullmatch(name) is not None


def file_of(folder: Path, language: str) -> Path:
    """Return the file with the translations of a folder into a language."""
    return folder / FOLDER / f"{language}.json"


def read(file: Path) -> dict[str, str]:
    """Return the translations in a file by English text.

    Raises:
        InvalidData: It cannot be read, is too large, or is not a JSON object of texts.
    """
    try:
        if file.stat().st_size > MAX_SIZE:
            raise InvalidData("{path} is larger than {size} bytes.", path=file, size=MAX_SIZE)
        return msgspec.json.decode(file.read_bytes(), type=dict[str, str])
    except OSError as error:
        raise InvalidData("{path} cannot be read: {reason}.", path=file, reason=error.strerror) from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise InvalidData("{path} is not a JSON object of texts: {reason}.", path=file, reason=error) from error


def texts_of(found: TypeAnalysis) -> Iterator[str]:
    """Yield the texts of an object type that the editor shows: names, descriptions and categories."""
    meta = found.meta
    yield meta.type if isinstance(meta.display_name, Unset) else meta.display_name
    yield meta.description
    yield from (each for each in (meta.category, *(action.category for action in found.actions)) if each)
    first_words = Counter(each.name.split("_")[0] for each in meta.settings)
    yield from (word for word, count in first_words.items() if count >= GROUPED)
    parameters = [each for action in found.actions for each in action.parameters]
    described: list[ObjectAction | ParameterMeta] = [*found.actions, *meta.settings, *parameters]
    for each in described:
        yield each.name.replace("_", " ")
        if not isinstance(each.description, Unset):
            yield each.description


def faults(folder: Path, keys: Iterable[str]) -> list[str]:
    """Return a sentence for each fault of the translations in a folder.

    Args:
        folder: Folder of the driver.
        keys: Texts and templates of the driver.
    """
    known, wrong = set(keys), []
    for file in sorted((folder / FOLDER).glob("*")):
        if file.suffix != ".json" or not is_language(file.stem):
            wrong.append(f"{file.name}: not named by a language, such as cs.json")
            continue
        try:
            found = read(file)
        except InvalidData as error:
            wrong.append(str(error))
            continue
        for key, text in found.items():
            if key not in known:
                wrong.append(f"{file.name}: the driver has no text {key!r}")
            elif problem := _problem(key, text):
                wrong.append(f"{file.name}: {key!r}: {problem}")
    return wrong


def _problem(key: str, text: str) -> str:
    """Return the problem of a translation; empty if there is none."""
    if not text.strip():
        return "the translation is empty"
    try:
        needed = fields_of(key)
    except ValueError:  # a text with braces, not a template
        return ""
    try:
        given = fields_of(text)
    except ValueError as error:
        return f"the translation is malformed: {error}"
    names = ", ".join(f"{{{name}}}" for name in sorted(needed ^ given))
    return f"text and translation differ in {names}" if names else ""
