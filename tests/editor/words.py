"""Texts of the editor in its languages, from the catalogues of the sources."""

import json
import re
from pathlib import Path
from typing import Final

from arcor2_hw.analysis.translations import FOLDER

ROOT: Final = Path(__file__).resolve().parents[2]
CATALOGUES: Final = ROOT / "editor" / "src" / "i18n"
_ENTRY: Final = re.compile(r'^(?:msgctxt "(.*)"\n)?msgid (".*")\nmsgstr (".*")$', re.MULTILINE)


def server_texts(language: str) -> dict[str, str]:
    """Return the translations of the library, the server and the drivers by English text."""
    texts: dict[str, str] = {}
    for folder in ("arcor2_hw", "server", "drivers"):
        for path in (ROOT / folder).rglob(f"{FOLDER}/{language}.json"):
            texts |= json.loads(path.read_text())
    return texts


class Words:
    """Translations of the editor's English texts. `words("Open {name}", name="a")` is the text with its value."""

    def __init__(self, language: str) -> None:
        self.language = language
        content = (CATALOGUES / f"{language}.po").read_text("utf-8")
        self._texts: dict[tuple[str, str], str] = {
            (context, json.loads(original)): json.loads(text) for context, original, text in _ENTRY.findall(content)
        }

    def __call__(self, english: str, /, context: str = "", **values: str) -> str:
        text = self._texts.get((context, english)) or self._texts["", english]
        for name, value in values.items():
            text = text.replace(f"{{{name}}}", value)
        return text

    def server(self, english: str) -> str:
        """Return the translation of a text of the server or of a driver."""
        return server_texts(self.language)[english]
