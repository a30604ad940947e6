"""A pseudo-locale: English texts in accented letters, longer by a tenth or, if they are not short, by a third.

A text in plain letters did not come from a catalogue.
"""

import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final

import msgspec
from playwright.async_api import Page, Route

from tests.editor.words import ROOT, Words, server_texts

LOCALE: Final = "de"
"""The language that the pseudo-locale replaces in the browser."""
_PLAIN: Final = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
_ACCENTED: Final = "áƀçđéƒǵĥíĵķļɱñóƥɋŕšťúṽŵẋýžÁƁÇĐÉƑǴĤÍĴĶĻṀÑÓƤɊŔŠŤÚṼŴẊÝŽ"
_LETTERS: Final = str.maketrans(_PLAIN, _ACCENTED)
_LONGER: Final = str.maketrans({letter: letter * 2 for letter in "áéíóúÁÉÍÓÚ"})
_SLIGHTLY_LONGER: Final = str.maketrans({"é": "éé"})
_SHORT: Final = 12
"""Largest number of letters of a short text. Few controls have room for a longer one."""
_MESSAGES: Final = re.compile(r"JSON\.parse\(`(.*?[^\\])`\)", re.DOTALL)
_FIELD: Final = re.compile(r"\{\w*\}")
_UNTRANSLATED: Final = (Path(__file__).with_name("untranslated.js")).read_text()


def pseudo(text: str) -> str:
    """Return a text in the pseudo-locale. Fields stay unchanged."""
    plain = sum(letter in _PLAIN for letter in _FIELD.sub("", text))
    longer = _LONGER if plain > _SHORT else _SLIGHTLY_LONGER
    parts = _FIELD.split(text)
    fields = [*_FIELD.findall(text), ""]
    return "".join(
        part.translate(_LETTERS).translate(longer) + field for part, field in zip(parts, fields, strict=True)
    )


def _message(parts: Any) -> Any:
    """Return a compiled message of Lingui in the pseudo-locale: texts, and lists of a field, its kind and its forms."""
    if isinstance(parts, str):
        return pseudo(parts)
    whole = pseudo("{}".join(each for each in parts if isinstance(each, str))).split("{}")
    texts = iter(whole)
    return [next(texts) if isinstance(each, str) else _field(each) for each in parts]


def _field(field: list[Any]) -> list[Any]:
    forms = [
        {k: _message(v) if k != "offset" else v for k, v in each.items()}
        for each in field[2:3]
        if isinstance(each, dict)
    ]
    return [*field[:2], *(forms or field[2:])]


class PseudoWords(Words):
    """Texts of the editor in the pseudo-locale."""

    def __init__(self) -> None:
        super().__init__("en")

    def __call__(self, english: str, /, context: str = "", **values: str) -> str:
        text = pseudo(super().__call__(english, context))
        for name, value in values.items():
            text = text.replace(f"{{{name}}}", value)
        return text

    def server(self, english: str) -> str:
        return pseudo(english)


async def use_pseudo_locale(page: Page) -> None:
    """Replace the catalogue of `LOCALE` and the server's texts in this language by the pseudo-locale."""
    texts = {key: pseudo(key) for key in server_texts(LOCALE)}
    assets = ROOT / "server" / "arcor2_server" / "editor_files" / "assets"
    content = next(assets.glob("en-*.js")).read_text()
    found = _MESSAGES.search(content)
    assert found is not None, "the catalogue of the built editor has another form"
    plain = re.sub(r"\\([\\`$])", r"\1", found[1])
    messages = {name: _message(parts) for name, parts in json.loads(plain).items()}

    async def catalogue(route: Route) -> None:
        body = f"export const messages = {json.dumps(messages)};"
        await route.fulfill(body=body, content_type="text/javascript")

    async def translations(route: Route) -> None:
        await route.fulfill(json=texts)

    await page.route(f"**/assets/{LOCALE}-*.js", catalogue)
    await page.route(f"**/api/translations/{LOCALE}", translations)


def names_in(*documents: Any) -> set[str]:
    """Return the names and values that users typed into documents."""
    found = {each for document in documents for each in _strings(msgspec.to_builtins(document))}
    return {each for each in found if re.search("[A-Za-z]{2}", each)}


def _strings(value: Any) -> Iterator[str]:
    match value:
        case str():
            yield value
        case dict():
            for each in value.values():
                yield from _strings(each)
        case list():
            for each in value:
                yield from _strings(each)


async def untranslated(page: Page, names: Iterable[str]) -> list[str]:
    """Return visible texts, labels and hints in plain letters, other than these names, units and code."""
    return list(await page.evaluate(_UNTRANSLATED, sorted(names, key=len, reverse=True)))
