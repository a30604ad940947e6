"""The page over plain HTTP from which a device installs the local certificate authority. It serves nothing else."""

import base64
import hashlib
import html
import plistlib
import socket
import ssl
import uuid
from pathlib import Path
from typing import Any, Final

from arcor2_server.access.origin import HostNames, host_of
from arcor2_server.settings import ServerSettings
from arcor2_server.web.response_headers import COMMON_HEADERS
from arcor2_server.web.trust_texts import TEXTS, TrustTexts

CERTIFICATE: Final = "/authority.crt"
PROFILE: Final = "/authority.mobileconfig"

_STYLE: Final = """
:root { color-scheme: light dark; font: 1.05rem/1.5 system-ui, sans-serif; }
body { max-width: 42rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-bottom: 0; }
code { display: block; overflow-wrap: anywhere; font-size: 0.95rem; padding: 0.5rem 0; }
a.action { display: inline-block; min-height: 2.75rem; line-height: 2.75rem; padding: 0 1rem; margin: 0.25rem 0;
  border-radius: 0.5rem; background: #0b57d0; color: #fff; text-decoration: none; font-weight: 600; }
li { margin: 0.35rem 0; }
"""
_POLICY: Final = (
    f"default-src 'none'; style-src 'sha256-{base64.b64encode(hashlib.sha256(_STYLE.encode()).digest()).decode()}'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class TrustPage:
    """An ASGI application with three resources: the page, the certificate of the authority, and a profile for iOS.

    Args:
        authority: PEM file of the authority.
        settings: the settings of the server, for its valid host names.
    """

    def __init__(self, authority: Path, settings: ServerSettings) -> None:
        self._authority = authority
        self._names = HostNames.of(settings)

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Answer a request. Refuse a websocket, since its token would be readable on the network."""
        if scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 4403, "reason": "use wss://"})
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        status, content, media_type, more = self._response(scope, headers)
        sent = COMMON_HEADERS | {
            "Content-Type": media_type,
            "Content-Length": str(len(content)),
            "Content-Security-Policy": _POLICY,
            "Cache-Control": "no-store",
            **more,
        }
        raw = [(name.lower().encode(), value.encode("latin-1")) for name, value in sent.items()]
        await send({"type": "http.response.start", "status": status, "headers": raw})
        await send({"type": "http.response.body", "body": b"" if scope["method"] == "HEAD" else content})

    def _response(self, scope: Any, headers: dict[str, str]) -> tuple[int, bytes, str, dict[str, str]]:
        if scope["method"] not in ("GET", "HEAD"):
            return 405, b"Use https.", "text/plain", {"Allow": "GET, HEAD"}
        host = headers.get("host")
        if (name := host_of(host)) not in self._names:
            return 403, b"This server has another name. Use its address.", "text/plain", {}
        der = ssl.PEM_cert_to_DER_cert(self._authority.read_text("ascii"))
        if scope["path"] == CERTIFICATE:
            attachment = {"Content-Disposition": f'attachment; filename="arcor2-hw-{socket.gethostname()}.crt"'}
            return 200, der, "application/x-x509-ca-cert", attachment
        if scope["path"] == PROFILE:
            return 200, profile(der, socket.gethostname()), "application/x-apple-aspen-config", {}
        language = preferred_language(headers.get("accept-language", ""))
        content = page(TEXTS[language], language, f"https://{host}/", str(name), der)
        return (200 if scope["path"] == "/" else 404), content.encode(), "text/html; charset=utf-8", {}


def preferred_language(accepted: str) -> str:
    """Return the first language of an Accept-Language header for which there are texts, else English."""
    for part in accepted.lower().split(","):
        if (language := part.partition(";")[0].strip()[:2]) in TEXTS:
            return language
    return "en"


def page(texts: TrustTexts, language: str, editor: str, host: str, der: bytes) -> str:
    """Return the page.

    Args:
        texts: its texts.
        language: their language.
        editor: URL of the editor.
        host: name or address with which the device reaches the server.
        der: certificate of the authority.
    """
    sha256 = hashlib.sha256(der).digest().hex(":").upper()
    link = f'<a class="action" href="{html.escape(editor)}">{html.escape(texts.open_editor)}</a>'

    def steps(title: str, file: str, action: str, further: tuple[str, str]) -> str:
        first = f'<a class="action" href="{file}">{html.escape(action)}</a>'
        items = "".join(f"<li>{item}</li>" for item in (first, *map(html.escape, further)))
        return f"<section><h2>{html.escape(title)}</h2><ol>{items}</ol></section>"

    return (
        f'<!doctype html><html lang="{language}"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(texts.title)}</title><style>{_STYLE}</style>"
        f"<h1>{html.escape(texts.title)}</h1><p>{html.escape(texts.purpose.format(host=host))}</p>"
        f"<p>{html.escape(texts.compare)}</p><code>{sha256}</code>"
        f"{steps(texts.android, CERTIFICATE, texts.download, texts.android_steps)}"
        f"{steps(texts.ipad, PROFILE, texts.download_profile, texts.ipad_steps)}"
        f"{steps(texts.desktop, CERTIFICATE, texts.download, texts.desktop_steps)}"
        f"<p>{html.escape(texts.then)}</p><p>{link}</p></html>"
    )


def profile(der: bytes, host: str) -> bytes:
    """Return a configuration profile for iOS and iPadOS that installs an authority.

    Its identifiers follow from the certificate, so that a second installation replaces the first one.

    Args:
        der: certificate of the authority.
        host: name of the server.
    """
    ids = [str(uuid.uuid5(uuid.NAMESPACE_OID, hashlib.sha256(der).hexdigest() + part)) for part in ("root", "profile")]
    identifier = f"arcor2-hw.{ids[1]}"
    root = {
        "PayloadType": "com.apple.security.root",
        "PayloadVersion": 1,
        "PayloadIdentifier": f"{identifier}.root",
        "PayloadUUID": ids[0],
        "PayloadDisplayName": f"ARCOR2-HW authority of {host}",
        "PayloadContent": der,
    }
    return plistlib.dumps({
        "PayloadType": "Configuration",
        "PayloadVersion": 1,
        "PayloadIdentifier": identifier,
        "PayloadUUID": ids[1],
        "PayloadDisplayName": f"ARCOR2-HW on {host}",
        "PayloadDescription": "Lets this device trust the ARCOR2-HW server in the local network.",
        "PayloadContent": [root],
    })  # fmt: skip
