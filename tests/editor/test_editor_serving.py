"""Serving the editor's page and files."""

import gzip
import re
from pathlib import Path

import httpx
import pytest
from litestar import Litestar

from arcor2_server.app import create_app, running_server
from arcor2_server.settings import ServerSettings
from arcor2_server.web.editor import NONCE, editor_routes

SCRIPT = b"export const answer = 42;\n" * 20


@pytest.fixture
def built(tmp_path: Path) -> Path:
    (tmp_path / "assets").mkdir()
    (tmp_path / "index.html").write_bytes(b'<meta property="csp-nonce" nonce="' + NONCE + b'"><p>page')
    (tmp_path / "assets" / "index-abc.js").write_bytes(SCRIPT)
    (tmp_path / "assets" / "index-abc.js.gz").write_bytes(gzip.compress(SCRIPT))
    (tmp_path / "assets" / "index-abc.js.br").write_bytes(b"not asked for here")
    (tmp_path / "favicon.svg").write_bytes(b"<svg/>")
    (tmp_path / ".vite").mkdir()
    (tmp_path / ".vite" / "manifest.json").write_text("{}")
    return tmp_path


def browser(directory: Path) -> httpx.AsyncClient:
    app = Litestar(route_handlers=editor_routes(directory), openapi_config=None, logging_config=None)
    return httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://127.0.0.1")


async def test_page_has_a_policy_with_a_fresh_nonce(built: Path) -> None:
    async with browser(built) as client:
        answers = [await client.get("/") for _ in range(2)]
    nonces = [re.findall(r'nonce="([\w-]+)"', answer.text)[0] for answer in answers]
    assert nonces[0] != nonces[1]
    for answer, nonce in zip(answers, nonces, strict=True):
        policy = dict(part.strip().partition(" ")[::2] for part in answer.headers["content-security-policy"].split(";"))
        assert policy["default-src"] == "'none'"
        assert policy["script-src"] == "'self'"
        assert policy["style-src"] == f"'self' 'nonce-{nonce}'"
        assert policy["frame-ancestors"] == "'none'"
        assert answer.headers["cache-control"] == "no-cache"
        assert answer.headers["content-type"] == "text/html; charset=utf-8"
        assert answer.text.endswith("<p>page")


async def test_hashed_files_are_compressed_and_cached_forever(built: Path) -> None:
    async with browser(built) as client:
        zipped = await client.get("/editor/assets/index-abc.js", headers={"accept-encoding": "gzip, br;q=0"})
        plain = await client.get("/editor/assets/index-abc.js", headers={"accept-encoding": "identity"})
        again = await client.get("/editor/assets/index-abc.js", headers={"if-none-match": plain.headers["etag"]})
    assert zipped.headers["content-encoding"] == "gzip"
    assert zipped.headers["vary"] == "Accept-Encoding"
    assert zipped.content == plain.content == SCRIPT  # httpx has unpacked the former
    assert int(zipped.headers["content-length"]) < len(SCRIPT)
    assert "content-encoding" not in plain.headers
    assert plain.headers["cache-control"] == "public, max-age=31536000, immutable"
    assert plain.headers["content-type"] == "text/javascript; charset=utf-8"
    assert (again.status_code, again.content) == (304, b"")


async def test_files_without_a_hash_are_not_cached(built: Path) -> None:
    async with browser(built) as client:
        icon = await client.get("/editor/favicon.svg")
    assert (icon.text, icon.headers["cache-control"]) == ("<svg/>", "no-cache")


@pytest.mark.parametrize(
    "path", ["assets/other.js", "index.html", "assets/../../secret", "%2e%2e/secret", ".vite/manifest.json", ""]
)
async def test_only_built_files_are_served(built: Path, path: str) -> None:
    (built.parent / "secret").write_text("not for the web")
    async with browser(built) as client:
        answer = await client.get(f"/editor/{path}")
    assert answer.status_code == 404
    assert "not for the web" not in answer.text


async def test_missing_build_explains_how_to_build(tmp_path: Path) -> None:
    async with browser(tmp_path / "absent") as client:
        answer = await client.get("/")
    assert "make run" in answer.text


async def test_page_needs_no_token_but_foreign_origins_are_refused(tmp_path: Path) -> None:
    settings = ServerSettings(data_dir=tmp_path, host="192.0.2.1")  # on a network every client needs a token
    async with running_server(settings) as services:
        transport = httpx.ASGITransport(create_app(services))
        async with httpx.AsyncClient(timeout=60, transport=transport, base_url="http://192.0.2.1:6789") as client:
            assert (await client.get("/")).status_code == 200
            assert (await client.head("/")).status_code == 200
            assert (await client.get("/api/devices")).status_code == 401
            assert (await client.get("/", headers={"origin": "http://elsewhere.example"})).status_code == 403
            assert (await client.get("/no/such/page")).status_code == 404
