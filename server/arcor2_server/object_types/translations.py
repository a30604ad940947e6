"""Translations of the texts that the server sends, from files next to the code of the server, library and drivers."""

from collections.abc import Iterable
from pathlib import Path
from typing import Final

import structlog

from arcor2_hw.analysis.templates import LIBRARY
from arcor2_hw.analysis.translations import file_of, is_language, read
from arcor2_hw.exceptions import InvalidData

log = structlog.get_logger(__name__)

SERVER: Final = Path(__file__).resolve().parents[1]


def into(language: str, drivers: Iterable[Path]) -> dict[str, str]:
    """Return the translations into a language by English text; empty for an unknown language.

    Translations of the server and the library take precedence over those of drivers.

    Args:
        language: Language tag such as "cs".
        drivers: Folders of drivers. A faulty file is left out.
    """
    found: dict[str, str] = {}
    for folder in (*drivers, LIBRARY, SERVER) if is_language(language) else ():
        file = file_of(folder, language)
        if not file.exists():
            continue
        try:
            found |= read(file)
        except InvalidData as error:
            log.warning("translations left out", file=str(file), reason=str(error))
    return found
