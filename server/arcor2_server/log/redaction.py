"""Redacts secrets in logs and in exported files."""

import re
from collections.abc import Callable, Iterator, MutableMapping, Set
from typing import Any, Final

from arcor2_hw.data.secret import HIDDEN, is_secret_name

MIN_LENGTH: Final = 4
"""Minimum length of a secret that is searched for in texts; shorter ones occur in too many words."""

_VALUES: Final = ("value", "default_value")
_IN_TEXT: Final = (
    (re.compile(r"(?<=://)[^/@\s:\"]*:[^/@\s\"]*(?=@)"), HIDDEN),
    (re.compile(r"(?i)(?<=bearer )[\w.~+/=-]+"), HIDDEN),
    (re.compile(r"(?i)(\btoken=)[^&\s\"]+"), rf"\g<1>{HIDDEN}"),
    # Tokens created by `arcor2-hw token add`.
    (re.compile(r"(?<![\w-])[\w-]{43}(?![\w-])"), HIDDEN),
)


def hide(value: Any) -> Any:
    """Return JSON data with secrets hidden.

    A value is secret because of its key, or because of the `name` next to a `value`.
    """
    if isinstance(value, list):
        return [hide(item) for item in value]
    if not isinstance(value, dict):
        return value
    named = is_secret_name(str(value.get("name", "")))
    return {key: HIDDEN if item and _is_secret(key, item, named=named) else hide(item) for key, item in value.items()}


def secrets_in(value: Any) -> Iterator[str]:
    """Return the strings that `hide` hides."""
    if isinstance(value, list):
        for item in value:
            yield from secrets_in(item)
    elif isinstance(value, dict):
        named = is_secret_name(str(value.get("name", "")))
        for key, item in value.items():
            if not _is_secret(key, item, named=named):
                yield from secrets_in(item)
            elif isinstance(item, str):
                yield item.strip('"')  # settings are JSON


def clean(text: str, secrets: set[str]) -> str:
    """Return a text with secrets hidden: the given ones, tokens and passwords in URLs."""
    for secret in sorted(secrets, key=len, reverse=True):
        if len(secret) >= MIN_LENGTH:
            text = text.replace(secret, HIDDEN)
    for pattern, replacement in _IN_TEXT:
        text = pattern.sub(replacement, text)
    return text


class LogRedaction:
    """Hides the secret settings of devices in log lines (a processor of structlog)."""

    def __init__(self) -> None:
        self._secrets: Callable[[], Set[str]] = frozenset

    def hide(self, secrets: Callable[[], Set[str]]) -> None:
        """Hide the secrets that a function returns.

        It is called later, because the log exists before the secrets are read.
        """
        self._secrets = secrets

    def in_text(self, text: str) -> str:
        """Return a text without secrets."""
        return clean(text, set(self._secrets()))

    def __call__(self, _logger: Any, _name: str, event: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
        """Return an event without secrets."""
        secrets = [secret for secret in self._secrets() if len(secret) >= MIN_LENGTH]
        return {key: _without(value, secrets) for key, value in event.items()} if secrets else event


REDACTION: Final = LogRedaction()


def _without(value: Any, secrets: list[str]) -> Any:
    if isinstance(value, dict):
        return {key: _without(item, secrets) for key, item in value.items()}
    if isinstance(value, list):
        return [_without(item, secrets) for item in value]
    if isinstance(value, str):
        for secret in secrets:
            value = value.replace(secret, HIDDEN)
    return value


def _is_secret(key: str, item: Any, *, named: bool) -> bool:
    return not isinstance(item, dict | list) and ((named and key in _VALUES) or is_secret_name(key))
