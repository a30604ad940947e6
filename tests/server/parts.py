"""Parts of a server that a test puts together by hand."""

from types import SimpleNamespace
from typing import Any


class Parts(SimpleNamespace):
    """Parts by name as in `arcor2_server.app.Server`; a part that the test leaves out is None."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return None
