"""GET /api/translations: files next to drivers and the server, merged."""

from pathlib import Path

import httpx
import pytest

from arcor2_server.object_types import translations


def put(folder: Path, text: str, language: str = "cs") -> Path:
    file = folder / "translations" / f"{language}.json"
    file.parent.mkdir(parents=True)
    file.write_text(text)
    return folder


def test_translations_are_merged_and_those_of_the_server_take_precedence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(translations, "LIBRARY", tmp_path / "library")
    monkeypatch.setattr(translations, "SERVER", put(tmp_path / "server", '{"Stop": "Zastavit"}'))
    scale = put(tmp_path / "scale", '{"Stop": "Stůj", "weight": "hmotnost"}')
    broken = put(tmp_path / "broken", "{")
    assert translations.into("cs", [broken, scale, tmp_path]) == {"Stop": "Zastavit", "weight": "hmotnost"}
    assert translations.into("de", [scale]) == {}


@pytest.mark.parametrize("language", ["../cs", "CS", "cs.json", ""])
def test_an_invalid_language_has_no_translations(tmp_path: Path, language: str) -> None:
    assert translations.into(language, [put(tmp_path, '{"a": "b"}')]) == {}


@pytest.mark.asyncio(loop_scope="module")
async def test_the_route_answers_with_the_texts(http: httpx.AsyncClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(translations, "into", lambda language, drivers: {"some_text": f"{language} {len(drivers) > 9}"})
    answer = await http.get("/api/translations/cs")
    assert (answer.status_code, answer.json()) == (200, {"some_text": "cs True"})
