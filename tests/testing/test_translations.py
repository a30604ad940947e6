"""Checks of the translations of a driver, and of the templates that they translate."""

import functools
import json
from pathlib import Path

import pytest

from arcor2_hw.analysis.extraction import ENGLISH, texts, translated_by_library, update
from arcor2_hw.analysis.templates import LIBRARY, hard_coded, sources, templates
from arcor2_hw.analysis.translations import FOLDER, faults, file_of, is_language, read
from arcor2_hw.testing import declarations

ROOT = LIBRARY.parent
DRIVERS = sorted({Path(each.folder) for each in declarations.drivers()})
FOLDERS = [LIBRARY, ROOT / "server" / "arcor2_server", *DRIVERS]
DRIVER = '''
from arcor2_hw.exceptions import DeviceTimeout, Refused
from arcor2_hw.messages import Message


class Jammed(Refused):
    """It is jammed."""


def problems(self, open):
    yield DeviceTimeout("{device} did not answer within {limit:.1f} s.", "detail", device=self.who, limit=1)
    yield Jammed("Remove the {x}." if open else "Open it.")
    yield Message.of("{count} parts", count=2)
    text = "Close it."
    text = text if open else "Wait."
    yield Jammed(text)
    yield ValueError("not a message")
    yield Refused(str(self))
'''


def keys(folder: Path) -> set[str]:
    (folder / "driver.py").write_text(DRIVER)
    return {each.key for each in templates(sources(folder))}


def test_templates_are_found_in_errors_and_messages(tmp_path: Path) -> None:
    expected = {
        "{device} did not answer within {limit} s.",
        "Remove the {x}.",
        "Open it.",
        "{count} parts",
        "Close it.",
        "Wait.",
    }
    assert keys(tmp_path) == expected


def test_every_template_gets_the_values_of_its_fields() -> None:
    files = [path for folder in ("arcor2_hw", "server", "drivers") for path in sources(ROOT / folder)]
    found = templates(files)
    assert len(found) > 1000
    assert [each for each in found if not each.fields <= each.values] == []


def test_all_texts_for_users_are_templates() -> None:
    files = [path for folder in FOLDERS for path in sources(folder) if path.relative_to(folder).parts[0] not in ENGLISH]
    assert hard_coded(files) == []


@pytest.mark.parametrize(
    ("call", "found"),
    [
        ('Refused(f"Remove the {x}.")', True),
        ("Refused(str(error))", True),
        ('text = f"Remove the {x}."; Refused(text)', True),
        ('Refused("Remove the {x}.", x=x)', False),
        ('Refused(f"Remove the {PART}.")', False),
        ('Refused("{device}: {reason}", device=x, reason="the door is open" if x else x)', True),
        ('Refused("{device}: {reason}", device=x, reason=f"the door {x} is open")', True),
        ('Refused("{device}: {reason}", device=x, reason=str(error))', True),
        ('Refused("{device}: {reason}", device=x, reason=Phrase.of("the door is open"))', False),
        ('Refused("{device}: {reason}", f"detail of {x}", device=x, reason=error)', False),
        ('NotificationData("Remove the part.", level)', True),
        ("NotificationData(text.text, level, **text.translation())", False),
    ],
)
def test_texts_that_cannot_be_translated_are_found(tmp_path: Path, call: str, found: bool) -> None:
    (tmp_path / "driver.py").write_text(f'PART = "part"\ndef work(x):\n    {call}\n')
    assert bool(hard_coded([tmp_path / "driver.py"])) is found


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ('{"{count} parts": "{count} dílů", "Open it.": "Otevřete."}', ""),
        ('{"{count} parts": "díly"}', "differ in {count}"),
        ('{"{count} parts": "{count} {kusy}"}', "differ in {kusy}"),
        ('{"{count} parts": "{count"}', "malformed"),
        ('{"{count} parts": " "}', "is empty"),
        ('{"{count} pieces": "{count} dílů"}', "has no text '{count} pieces'"),
        ('{"{count} parts": 3}', "not a JSON object of texts"),
        ("{", "not a JSON object of texts"),
    ],
)
def test_faults_of_translations_are_named(tmp_path: Path, content: str, problem: str) -> None:
    file = tmp_path / FOLDER / "cs.json"
    file.parent.mkdir()
    file.write_text(content)
    found = faults(tmp_path, keys(tmp_path))
    assert len(found) == bool(problem)
    assert problem in "".join(found)


def test_a_file_is_named_by_its_language(tmp_path: Path) -> None:
    (tmp_path / FOLDER).mkdir()
    (tmp_path / FOLDER / "czech.json").write_text(json.dumps({}))
    assert "not named by a language" in faults(tmp_path, ())[0]
    assert [name for name in ("cs", "pt-BR", "CS", "../cs", "czech") if is_language(name)] == ["cs", "pt-BR"]


def test_texts_include_those_of_the_object_type() -> None:
    scale = next(each for each in declarations.drivers() if each.name == "MtSicsScale")
    assert scale.file is not None
    known = texts(Path(scale.folder))
    assert {"Mettler Toledo scale", "tare", "the load is above the weighing range", "remove the load"} <= known
    assert not known & translated_by_library()


def test_extraction_keeps_translations_and_removes_unused_ones(tmp_path: Path) -> None:
    expected = keys(tmp_path)
    file = tmp_path / FOLDER / "cs.json"
    assert update(tmp_path, "cs") == len(expected)
    file.write_text(json.dumps({"Open it.": "Otevřete ji.", "gone": "pryč"}))
    assert update(tmp_path, "cs") == len(expected) - 1
    content = json.loads(file.read_text())
    assert content == {key: "Otevřete ji." if key == "Open it." else "" for key in expected}
    assert list(content) == sorted(content)


_texts = functools.cache(texts)


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
@pytest.mark.parametrize("language", ["cs", "de"])
def test_texts_of_the_project_are_translated(folder: Path, language: str) -> None:
    """A fault is fixed by `python -m arcor2_hw.analysis.extraction FOLDER`, and by translating the new texts."""
    found, known = read(file_of(folder, language)), _texts(folder)
    assert sorted(known - set(found)) == []
    assert faults(folder, known) == []
