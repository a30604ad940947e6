"""Foreign web pages are kept out, programs and our own pages are not."""

from pathlib import Path

import httpx
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from arcor2_server.origin import may_connect
from arcor2_server.settings import ServerSettings
from tests.server.core.serving import ServerProcess


@pytest.mark.parametrize(
    ("origin", "host", "may"),
    [
        (None, "robots.example:6789", True),
        ("http://127.0.0.1:6789", "127.0.0.1:6789", True),
        ("http://localhost:6789", "localhost:6789", True),
        ("http://[::1]:6789", "[::1]:6789", True),
        ("https://192.168.1.5", "192.168.1.5", True),
        ("http://cell.example:6789", "cell.example:6789", True),
        ("http://evil.example", "127.0.0.1:6789", False),
        ("http://127.0.0.1:8000", "127.0.0.1:6789", False),
        ("http://rebound.example:6789", "rebound.example:6789", False),
        ("null", "127.0.0.1:6789", False),
        ("http://127.0.0.1:6789", None, False),
        ("http://[::1", "127.0.0.1:6789", False),
        ("http://127.0.0.1:99999", "127.0.0.1:99999", False),
    ],
)
def test_who_may_connect(origin: str | None, host: str | None, may: bool) -> None:
    assert may_connect(origin, host, frozenset({"cell.example"})) is may


def test_names_are_taken_from_the_environment(tmp_path: Path) -> None:
    environment = {"ARCOR2_HW_ALLOWED_HOSTS": "cell.example, cell"}
    settings = ServerSettings.from_environment(environment, data_dir=tmp_path)
    assert settings.allowed_hosts == {"cell.example", "cell"}


async def test_a_foreign_page_gets_neither_the_websocket_nor_a_route(server: ServerProcess) -> None:
    foreign = {"Origin": "http://evil.example"}
    with pytest.raises(InvalidStatus) as refused:
        await connect(server.url, additional_headers=foreign)
    assert refused.value.response.status_code == 403
    url = server.url.replace("ws://", "http://")
    async with httpx.AsyncClient(base_url=url) as http:
        body = {"id": "Evil", "name": "Evil", "source": "class Evil: ..."}
        assert (await http.put("/object-types", json=body, headers=foreign)).status_code == 403
        assert (await http.get("/object-types", headers={"Origin": url})).json() == []
    async with connect(server.url, additional_headers={"Origin": url}) as own:
        assert "ShowMainScreen" in str(await own.recv())
