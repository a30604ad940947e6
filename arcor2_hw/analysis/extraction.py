"""Extraction of the texts that can be translated from the folders of drivers, the library and the server.

`python -m arcor2_hw.analysis.extraction FOLDER... [--language LANGUAGE]...` updates `translations/<language>.json` in
each folder: new texts get an empty translation, translations of texts that no longer exist are removed.
"""

import argparse
import json
import re
import sys
from collections.abc import Iterable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Final

from arcor2_hw.analysis import alarms
from arcor2_hw.analysis.installed import installed_types
from arcor2_hw.analysis.library import BUILT_IN, Library
from arcor2_hw.analysis.source import SourceFile
from arcor2_hw.analysis.templates import LIBRARY, sources, templates
from arcor2_hw.analysis.translations import FOLDER, file_of, read, texts_of

ENGLISH: Final = frozenset({"cli", "client", "demo", "deployment", "exchange", "testing"})
"""Packages whose texts are only shown by the command line, by scripts or in logs."""
_FIELD: Final = re.compile(r"\{\w+\}")


def texts(folder: Path, types: Iterable[SourceFile] = ()) -> frozenset[str]:
    """Return the texts of a folder that users see: of messages, alarms and object types.

    Args:
        folder: Folder of a driver, the library or the server. Texts of a driver that are also texts of the library
            are left out, since the library translates them.
        types: Files of object types in the folder that are not installed.
    """
    if folder == LIBRARY:
        return _found(LIBRARY)
    return _found(folder, types) - translated_by_library()


@lru_cache(maxsize=1)
def translated_by_library() -> frozenset[str]:
    """Return the texts that the library translates. Extracting them from its source would take a second."""
    return frozenset(text for file in (LIBRARY / FOLDER).glob("*.json") for text in read(file))


def _found(folder: Path, types: Iterable[SourceFile] = ()) -> frozenset[str]:
    files = [path for path in sources(folder) if path.relative_to(folder).parts[0] not in ENGLISH]
    found = {each.key for each in templates(files)}.union(_texts_of_types(folder, types))
    found |= set(alarms.texts_of(alarms.read(folder)))
    return frozenset(text for text in found if any(map(str.isalpha, _FIELD.sub("", text))))


def _texts_of_types(folder: Path, types: Iterable[SourceFile]) -> Iterator[str]:
    installed = [each.file for each in installed_types() if each.file and folder in Path(each.file.path).parents]
    files = [*installed, *(each for each in types if each.name not in {file.name for file in installed})]
    library = Library(files)
    for name in [*(each.name for each in files), *(BUILT_IN if folder == LIBRARY else ())]:
        yield from texts_of(library.analyse(name))


def update(folder: Path, language: str) -> int:
    """Update the file with the translations of a folder into a language; return how many are missing."""
    file = file_of(folder, language)
    known = read(file) if file.exists() else {}
    found = {text: known.get(text, "") for text in sorted(texts(folder))}
    file.parent.mkdir(exist_ok=True)
    file.write_text(json.dumps(found, indent=2, ensure_ascii=False) + "\n", "utf-8")
    return sum(not text for text in found.values())


def _main() -> None:
    parser = argparse.ArgumentParser(description="Update the translations in folders.")
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--language", action="append", help="by default those of the folder")
    given = parser.parse_args()
    for folder in (each.resolve() for each in given.folders):
        for language in given.language or sorted(file.stem for file in (folder / FOLDER).glob("*.json")):
            missing = update(folder, language)
            shown = file_of(folder, language)
            shown = shown.relative_to(Path.cwd()) if shown.is_relative_to(Path.cwd()) else shown
            sys.stdout.write(f"{shown}: {missing} texts to translate\n")


if __name__ == "__main__":
    _main()
