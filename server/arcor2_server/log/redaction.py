"""Redaction of secrets in logs and in files that leave the workplace."""

import re
from collections.abc import Callable, Iterator, MutableMapping, Set
from typing import Any, Final

from arcor2_hw.data.secret import HIDDEN, is_secret_name

SHORTEST: Final = 4
"""Minimum length of a secret that is searched in other texts; shorter ones occur in too many words."""

_VALUES: Final = ("value", "default_value")
_IN_TEXT: Final = (
    (re.compile(r"(?<=://)[^/@\s:\"]*:[^/@\s\"]*(?=@)"), HIDDEN),
    (re.compile(r"(?i)(?<=bearer )[\w.~+/=-]+"), HIDDEN),
    (re.compile(r"(?i)(\btoken=)[^&\s\"]+"), rf"\g<1>{HIDDEN}"),
    # What `arcor2-hw token add` makes.
    (re.compile(r"(?<![\w-])[\w-]{43}(?![\w-])"), HIDDEN),
)


def hide(value: Any) -> Any:
    """Return JSON data with the values of secrets hidden: by the key, or by the `name` that stands beside a `value`."""
    if isinstance(value, list):
        return [hide(item) for item in value]
    if not isinstance(value, dict):
        return value
    named = is_secret_name(str(value.get("name", "")))
    return {key: HIDDEN if item and _holds(key, item, named=named) else hide(item) for key, item in value.items()}


def secrets_in(value: Any) -> Iterator[str]:
    """Return the secrets that `hide` hides, where they are texts."""
    if isinstance(value, list):
        for item in value:
            yield from secrets_in(item)
    elif isinstance(value, dict):
        named = is_secret_name(str(value.get("name", "")))
        for key, item in value.items():
            if not _holds(key, item, named=named):
                yield from secrets_in(item)
            elif isinstance(item, str):
                yield item.strip('"')  # settings are JSON


def clean(text: str, secrets: set[str]) -> str:
    """Return a text without these secrets, and without what looks like a token or the password of an address."""
    for secret in sorted(secrets, key=len, reverse=True):
        if len(secret) >= SHORTEST:
            text = text.replace(secret, HIDDEN)
    for pattern, instead in _IN_TEXT:
        text = pattern.sub(instead, text)
    return text


class LogRedaction:
    """Hides secrets of settings in what is logged (a processor of structlog)."""

    def __init__(self) -> None:
        self.secrets: Callable[[], Set[str]] = frozenset
        """Returns the secrets to hide."""

    def __call__(self, _logger: Any, _name: str, event: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
        """Return an event without secrets."""
        secrets = [secret for secret in self.secrets() if len(secret) >= SHORTEST]
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


def _holds(key: str, item: Any, *, named: bool) -> bool:
    return not isinstance(item, dict | list) and ((named and key in _VALUES) or is_secret_name(key))
