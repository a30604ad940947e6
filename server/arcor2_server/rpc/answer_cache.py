"""Cache of encoded answers, valid as long as their sources are unchanged."""

from collections.abc import Callable
from typing import Any

from msgspec import Raw

from arcor2_server.events import encode


def cache_name(request: str, codes: bool) -> str:
    """Return the name of a cached answer, which depends on whether the caller asked for codes."""
    return f"{request} with codes" if codes else request


class AnswerCache:
    """Encoded answers by name. An answer is valid for the revisions of its sources from which it was made."""

    def __init__(self) -> None:
        self._answers: dict[str, tuple[tuple[int, ...], Raw]] = {}

    def get(self, name: str, revisions: tuple[int, ...]) -> Raw | None:
        """Return a cached answer, None if it is outdated."""
        answer = self._answers.get(name)
        return answer[1] if answer is not None and answer[0] == revisions else None

    def store(self, name: str, revisions: tuple[int, ...], encoded: bytes) -> Raw:
        """Store an encoded answer and return it. Take the revisions before reading the sources."""
        answer = Raw(encoded)
        self._answers[name] = (revisions, answer)
        return answer

    def get_or_encode(self, name: str, revisions: tuple[int, ...], make: Callable[[], Any]) -> Raw:
        """Return the cached answer, else encode and store the answer that `make` returns."""
        return self.get(name, revisions) or self.store(name, revisions, encode(make()))
