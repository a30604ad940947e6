"""A page for reading and trying the REST operations, generated from their OpenAPI document."""

import base64
import functools
import hashlib
import re
from pathlib import Path
from typing import Final

from arcor2_hw.data.role import Role
from arcor2_server.rest.general import SERVER
from arcor2_server.rest.operations import operation

PAGE: Final = Path(__file__).with_name("api_page.html")


@functools.cache
def page() -> str:
    """Return the page. Its content security policy allows only its own style and script, by their digests."""
    text = PAGE.read_text(encoding="utf-8")
    for kind, place in (("style", "STYLE"), ("script", "SCRIPT")):
        (content,) = re.findall(rf"<{kind}>(.*?)</{kind}>", text, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()
        text = text.replace(f"sha256-{place}", f"sha256-{digest}")
    return text


class ApiPageOperations:
    """The page for reading and trying the REST operations."""

    @operation("GET", "/swagger", SERVER, Role.OPERATOR, open=True, media_type="text/html")
    async def swagger_page(self) -> str:
        """Return a page for reading and trying all operations."""
        return page()
