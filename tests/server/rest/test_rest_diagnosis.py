"""The diagnosis bundle: its content, its limits, and secrets that it must not contain."""

import asyncio
import io
import json
import zipfile
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import msgspec
import pytest
import pytest_asyncio

from arcor2_hw.client import Client
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.role import Role
from arcor2_hw.data.secret import HIDDEN, is_secret_name
from arcor2_server.access.tokens import TokenFile
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.main import app
from arcor2_server.log.recent import MAX_LINE, RecentLog
from arcor2_server.log.redaction import clean, hide, secrets_in
from arcor2_server.rest.diagnosis_bundle import MAX_PART, packed
from tests.server.core.serving import ServerProcess, running

PASSWORD = "opensesame-7"


# ------------------------------------------------------------------------------------------------ secrets
@pytest.mark.parametrize("name", ["password", "user_password", "apiKey", "api_key", "token", "client_secret", "pin"])
def test_secrets_are_recognised_by_name(name: str) -> None:
    assert is_secret_name(name)
    assert hide({name: "x", "other": [{"name": name, "value": '"x"'}]}) == {
        name: HIDDEN,
        "other": [{"name": name, "value": HIDDEN}],
    }


@pytest.mark.parametrize("name", ["password_file", "host", "spinning", "keyboard", "compass"])
def test_other_values_are_not_hidden(name: str) -> None:
    value = {name: "x", "list": [{"name": name, "value": 1}], "none": None}
    assert hide(value) == value
    assert list(secrets_in(value)) == []


@pytest.mark.parametrize(
    ("text", "left"),
    [
        ("postgresql://ada:lovelace@db/x", "lovelace"),
        ("GET /?token=abc&x=1", "abc"),
        ("Authorization: Bearer abc.def", "abc"),
        (f"told {'aB-_' * 10}xyz by mail", "aB-_"),
        ("login with opensesame-7 refused", "opensesame"),
    ],
)
def test_secrets_are_removed_from_texts(text: str, left: str) -> None:
    cleaned = clean(text, {PASSWORD, "x"})
    assert left not in cleaned
    assert HIDDEN in cleaned
    assert clean("obj_0123456789abcdef0123456789abcdef at 127.0.0.1", {"1"}) == (
        "obj_0123456789abcdef0123456789abcdef at 127.0.0.1"
    )


def test_the_newest_part_of_the_log_is_included() -> None:
    log = RecentLog(max_bytes=100)
    for number in range(50):
        log.add(b"line %2d..." % number)
    assert log.lines() == [f"line {number}..." for number in range(40, 50)]
    log.add(b"x" * (2 * MAX_LINE))
    assert log.lines() == []  # the line is longer than the limit for all lines
    event = {"event": "failed", "_record": object(), "what": object(), "exc_info": ValueError("why")}
    wide = RecentLog()
    assert wide(None, "error", event) is event
    (line,) = wide.lines()
    assert "ValueError: why" in json.loads(line)["exception"]
    assert "_record" not in line


def test_an_oversized_document_is_omitted_with_a_note() -> None:
    large = {"about.json": {}, "scene.json": {"description": "x" * (MAX_PART + 1)}, "project.json": None}
    archive = packed(large)
    files = content(archive)
    assert "left_out" in json.loads(files["scene.json"])
    assert "project.json" not in files
    assert len(archive) < MAX_PART / 4


# ------------------------------------------------------------------------------------------------ the bundle
@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def server(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[ServerProcess]:
    data_dir = tmp_path_factory.mktemp("diagnosis") / "data"
    TokenFile(data_dir).add("first", Role.TECHNICIAN)
    async with running(data_dir) as process:
        yield process


def secret(server: ServerProcess, role: Role) -> str:
    return TokenFile(server.data_dir).add(f"{role.name} {len(TokenFile(server.data_dir).all())}", role)[1]


def content(archive: bytes) -> dict[str, str]:
    with zipfile.ZipFile(io.BytesIO(archive)) as files:
        assert files.testzip() is None
        return {name: files.read(name).decode() for name in files.namelist()}


@pytest.mark.asyncio(loop_scope="module")
async def test_the_bundle_contains_open_documents_and_no_secrets(
    server: ServerProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    key, operator = secret(server, Role.TECHNICIAN), secret(server, Role.OPERATOR)
    base = server.url.replace("ws", "http", 1)

    def by(token: str) -> dict[str, str]:
        return {"Authorization": f"Bearer {token}"}

    async with Client(server.url, "ada", token=key) as client, httpx.AsyncClient(timeout=60, base_url=base) as http:
        await client.new_scene("hall 7")
        values: dict[str, Any] = {"host": "127.0.0.9", "password": PASSWORD}
        given = [Parameter(name, "string", msgspec.json.encode(value).decode()) for name, value in values.items()]
        await client.add_object_to_scene(name="two_arms", type="YuMi", pose=Pose(), parameters=given)
        assert (await http.get("/api/devices", headers=by("wrong-token"))).status_code == 401  # logged

        assert (await http.get("/api/diagnosis")).status_code == 401
        assert (await http.get("/api/diagnosis", headers=by(operator))).status_code == 403
        answer = await http.get("/api/diagnosis", headers=by(key))
        assert (answer.status_code, answer.headers["content-type"]) == (200, "application/zip")
        files = content(answer.content)
        assert set(files) == {
            *("README.txt", "about.json", "types.json", "scene.json", "devices.json", "runs.json", "log.jsonl")
        }
        whole = "\n".join(files.values())
        for hidden in (key, operator, PASSWORD, "wrong-token", *(t.digest for t in TokenFile(server.data_dir).all())):
            assert hidden not in whole
        scene = json.loads(files["scene.json"])
        assert (scene["name"], scene["objects"][0]["name"]) == ("hall 7", "two_arms")
        parameters = {each["name"]: each["value"] for each in scene["objects"][0]["parameters"]}
        assert parameters == {"host": '"127.0.0.9"', "password": HIDDEN}
        about = json.loads(files["about.json"])
        assert about["people"] == ["ada"]
        assert about["settings"]["data_dir"] == str(server.data_dir)
        assert about["packages"]["arcor2-hw"]
        kinds = {each["type"]: each for each in json.loads(files["types.json"])}
        assert kinds["YuMi"]["from"] == "arcor2-hw"
        assert json.loads(files["devices.json"])["unsaved"] is True
        events = [json.loads(line)["event"] for line in files["log.jsonl"].splitlines()]
        assert "wrong token" in events

        # A client's own notes are included and redacted as well; too many are refused.
        client_notes = {"client": {"errors": [f"refused {PASSWORD}", f"at /?token={key}"], "token": key}}
        answer = await http.post("/api/diagnosis", json=client_notes, headers=by(key))
        notes = content(answer.content)["client.json"]
        assert json.loads(notes) == {"errors": [f"refused {HIDDEN}", f"at /?token={HIDDEN}"], "token": HIDDEN}
        much = {"client": {"errors": ["x" * 300_000]}}
        assert (await http.post("/api/diagnosis", json=much, headers=by(key))).status_code == 400

        target = tmp_path / "out.zip"
        arguments = ["diagnosis", str(target), "--url", server.url, "--token", key]
        assert await asyncio.to_thread(app, arguments) == ExitStatus.OK
        assert "not sent anywhere" in capsys.readouterr().out
        assert json.loads(content(target.read_bytes())["scene.json"]) == scene
        assert await asyncio.to_thread(app, arguments) == ExitStatus.CONFLICT
        assert "--force" in capsys.readouterr().err
        forbidden = [*arguments[:1], str(tmp_path / "no.zip"), "--url", server.url, "--token", operator]
        assert await asyncio.to_thread(app, forbidden) == ExitStatus.NOT_PERMITTED
        assert not (tmp_path / "no.zip").exists()
