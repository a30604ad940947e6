"""Serves the web editor: the page at `/` and its files below `/editor`."""

import asyncio
import hashlib
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from litestar import HttpMethod, Request, Response, route
from litestar.exceptions import NotFoundException
from litestar.handlers import HTTPRouteHandler

from arcor2_hw.data.base import Data
from arcor2_hw.data.role import Role
from arcor2_hw.messages import translatable
from arcor2_server.access.route_options import OPEN, ROLE
from arcor2_server.web.encodings import accepted_encodings

FILES: Final = Path(__file__).parents[1] / "editor_files"
"""Directory of the built editor; missing in a checkout without a build."""
EDITOR_PAGE: Final = "index.html"
FLEET_PAGE: Final = "fleet.html"
"""The pages of the build."""
NONCE: Final = b"__NONCE__"
"""Placeholder in the page for the nonce of inserted styles. Each response has its own nonce."""
NOT_BUILT: Final = (
    b"<!doctype html><html lang=en><meta charset=utf-8><title>ARCOR2-HW</title>"
    b"<h1>The editor is not built</h1><p>The server runs. In a checkout, <code>make run</code> builds the editor."
)
IMMUTABLE: Final = "public, max-age=31536000, immutable"
_MEDIA_TYPES: Final = {
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
    ".json": "application/json",
    ".png": "image/png",
    ".woff2": "font/woff2",
    ".wasm": "application/wasm",
}
_ENCODINGS: Final = (("br", ".br"), ("gzip", ".gz"))
"""Content encodings and the suffixes of compressed files, smallest files first."""
_PAGE: Final = {
    "Cache-Control": "no-cache",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Permissions-Policy": "camera=(self), xr-spatial-tracking=(self), fullscreen=(self), microphone=(), geolocation=()",
}


class EditorFile(Data, frozen=True):
    """A file with its content by encoding; "" is the uncompressed content."""

    media_type: str
    etag: str
    content: Mapping[str, bytes]


def file_names(directory: Path) -> frozenset[str]:
    """Return the paths of the editor's files relative to `directory`; empty if the editor is not built."""
    endings = tuple(ending for _, ending in _ENCODINGS)
    found = (file.relative_to(directory) for file in directory.rglob("*") if file.is_file())
    return frozenset(
        name.as_posix()
        for name in found
        # Hidden files belong to the build.
        if not name.name.endswith(endings) and not any(part.startswith(".") for part in name.parts)
    )


def read_file(file: Path) -> EditorFile:
    """Read a file of the editor with its compressed copies. Raise OSError if it cannot be read."""
    content = {"": file.read_bytes()}
    for encoding, ending in _ENCODINGS:
        if (compressed := file.with_name(file.name + ending)).is_file():
            content[encoding] = compressed.read_bytes()
    media_type = _MEDIA_TYPES.get(file.suffix, "application/octet-stream")
    return EditorFile(media_type, f'"{hashlib.sha256(content[""]).hexdigest()[:32]}"', content)


def page_policy(nonce: str) -> str:
    """Return the content security policy of the page: only content of this server, and no inline scripts."""
    return (
        "default-src 'none'; script-src 'self'; connect-src 'self'; img-src 'self' data: blob:; "
        f"style-src 'self' 'nonce-{nonce}'; font-src 'self'; worker-src 'self' blob:; media-src 'self' blob:; "
        "manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


def editor_routes(directory: Path = FILES, page_name: str = EDITOR_PAGE) -> list[HTTPRouteHandler]:
    """Return the routes of a page and of the files of all pages. They need no token. Files are read when requested."""
    names = file_names(directory)
    page = read_file(directory / page_name) if page_name in names else None
    files: dict[str, EditorFile] = {}
    open_to_all = {ROLE: Role.OPERATOR, OPEN: True}

    @route("/", http_method=[HttpMethod.GET, HttpMethod.HEAD], opt=open_to_all, name="editor page")
    async def editor_page() -> Response[bytes]:
        """Return the page. It is not cached, since each response has its own nonce."""
        nonce = secrets.token_urlsafe(16)
        content = NOT_BUILT if page is None else page.content[""].replace(NONCE, nonce.encode())
        headers = _PAGE | {"Content-Security-Policy": page_policy(nonce)}
        return Response(content, media_type="text/html", headers=headers)

    @route("/editor/{path:path}", http_method=[HttpMethod.GET, HttpMethod.HEAD], opt=open_to_all, name="editor file")
    async def editor_file(request: Request[Any, Any, Any]) -> Response[bytes]:
        """Return a file in an accepted encoding; 304 if the browser has it, 404 if it does not exist."""
        name = str(request.path_params["path"]).lstrip("/")
        if name not in names or name in (EDITOR_PAGE, FLEET_PAGE):
            raise NotFoundException(translatable("The editor has no such file."))
        if (file := files.get(name)) is None:
            file = files[name] = await asyncio.to_thread(read_file, directory / name)
        # The build names these files after their content, so they never change.
        caching = IMMUTABLE if name.startswith("assets/") else "no-cache"
        headers = {"Cache-Control": caching, "ETag": file.etag, "Vary": "Accept-Encoding"}
        if request.headers.get("if-none-match") == file.etag:
            return Response(b"", status_code=304, media_type=file.media_type, headers=headers)
        accepted = accepted_encodings(request)
        encoding = next((each for each, _ in _ENCODINGS if each in accepted and each in file.content), "")
        if encoding:
            headers["Content-Encoding"] = encoding
        return Response(file.content[encoding], media_type=file.media_type, headers=headers)

    return [editor_page, editor_file]
