"""The signed claims (JWT) that the broker checks: who may connect, and to which subjects.

Source: https://docs.nats.io, "JWTs and privacy", and https://github.com/nats-io/jwt, version 2 of the claims.
"""

import base64
import secrets
import time
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import msgspec

from arcor2_server.nodes.nkeys import SigningKey

_VERSION: Final = 2
_UNLIMITED: Final = -1
_HEADER: Final = {"typ": "JWT", "alg": "ed25519-nkey"}
_LIMITS: Final = {
    "subs": _UNLIMITED, "data": _UNLIMITED, "payload": _UNLIMITED, "imports": _UNLIMITED, "exports": _UNLIMITED,
    "conn": _UNLIMITED, "leaf": _UNLIMITED, "wildcards": True,
}  # fmt: skip
_STORAGE: Final = {"mem_storage": _UNLIMITED, "disk_storage": _UNLIMITED, "streams": _UNLIMITED, "consumer": _UNLIMITED}
"""Limits of JetStream, which an account may use if the broker has it."""
_FOREVER: Final = 253_402_300_799
"""End of the year 9999, s since 1970. A revoked key is never used again, so no clock matters."""


class Rights(NamedTuple):
    """What a user may publish and subscribe. leaf: whether it is a broker that connects as a leaf node."""

    publish: Sequence[str]
    subscribe: Sequence[str]
    leaf: bool = False


def operator(key: SigningKey, system_account: str) -> str:
    """Return the claim of the operator, whose accounts the broker accepts."""
    return _signed(key, key.public, "ARCOR2-HW", {"type": "operator", "system_account": system_account})


def account(
    signer: SigningKey,
    account_key: str,
    name: str,
    revoked: Sequence[str] = (),
    *,
    storage: bool = True,
    issued: int = 0,
) -> str:
    """Return the claim of an account.

    Args:
        signer: key of the operator.
        account_key: public key of the account.
        name: its name.
        revoked: public keys of users who must not connect.
        storage: whether the account may use JetStream.
        issued: when it was issued, s since 1970; 0 for now.
    """
    claim: dict[str, Any] = {"type": "account", "limits": _LIMITS | (_STORAGE if storage else {})}
    if revoked:
        claim["revocations"] = dict.fromkeys(revoked, _FOREVER)
    return _signed(signer, account_key, name, claim, issued)


def user(signer: SigningKey, user_key: str, name: str, rights: Rights | None = None) -> str:
    """Return the claim of a user.

    Args:
        signer: key of the account.
        user_key: public key of the user.
        name: its name.
        rights: what it may publish and subscribe; None for everything in the account. It may not answer requests in
            general: it could send a request with any subject for the answer to itself.
    """
    claim: dict[str, Any] = {"type": "user", "pub": {}, "sub": {}}
    claim |= {"subs": _UNLIMITED, "data": _UNLIMITED, "payload": _UNLIMITED}
    if rights is not None:
        claim |= {"pub": {"allow": list(rights.publish)}, "sub": {"allow": list(rights.subscribe)}}
        # No websocket or MQTT, and a leaf node only if it is one.
        claim["allowed_connection_types"] = ["LEAFNODE" if rights.leaf else "STANDARD"]
    return _signed(signer, user_key, name, claim)


def _signed(signer: SigningKey, subject: str, name: str, claim: Mapping[str, Any], issued: int = 0) -> str:
    body = {
        "jti": secrets.token_hex(16),
        "iat": issued or int(time.time()),
        "iss": signer.public,
        "sub": subject,
        "name": name,
        "nats": {**claim, "version": _VERSION},
    }
    content = f"{_encoded(msgspec.json.encode(_HEADER))}.{_encoded(msgspec.json.encode(body))}"
    return f"{content}.{_encoded(signer.sign(content.encode()))}"


def _encoded(raw: bytes) -> str:
    return base64.urlsafe_b64encode(raw).decode().rstrip("=")
