"""Pairing: with a one-time code, a node and the server prove to each other who they are.

Cells, sites and the page of the fleet pair in the same manner.

The server listens with TLS and a certificate made for this pairing. Both ends prove that they know the code, with HMACs
of the certificate that each of them sees and of what they send. A computer in the middle needs another certificate, so
it can neither pass proofs on nor change a message. It could guess the code from a proof of the node, but scrypt makes
this take much longer than the code is valid. SCRAM (RFC 5802) binds its proofs to the channel in the same manner.
"""

import asyncio
import contextlib
import hashlib
import hmac
import secrets
import ssl
import tempfile
from collections.abc import AsyncIterator, Callable
from datetime import UTC, datetime, timedelta
from typing import Final

import msgspec
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

from arcor2_hw.exceptions import Arcor2Error, ConnectionLost, Refused
from arcor2_hw.messages import Message
from arcor2_server.nodes.credentials import Credentials, check_name
from arcor2_server.nodes.nkeys import Kind, SigningKey, is_user_key
from arcor2_server.nodes.opening import Opening, refusal_of
from arcor2_server.nodes.presence import own_version

PORT: Final = 4223
"""Default port of the server for pairing."""
CODE_VALIDITY: Final = 600.0
"""Time for which a code is valid, s."""
MAX_ATTEMPTS: Final = 3
"""Number of wrong codes after which the code is no longer valid."""
MESSAGE_TIMEOUT: Final = 10.0
"""Time limit for a message of the peer, s."""
CLOSE_TIMEOUT: Final = 1.0
"""Time limit for closing a connection, s."""
ALPHABET: Final = "23456789ABCDEFGHJKLMNPQRSTUVWXYZ"
"""Characters of codes, without those that look alike."""
CODE_SIZE: Final = 8
"""Number of characters of a code: 40 bits."""
_COST: Final = 1 << 16
"""Cost of a guess (scrypt): 64 MiB and some 0.2 s. Trying all codes takes 7,000 years of processor time."""
_MEMORY: Final = 1 << 27
_MAX_MESSAGE_SIZE: Final = 64 * 1024
"""Maximum size of a message, bytes."""


class Request(msgspec.Struct, frozen=True):
    """The request of a node: its name, public key and version, and a random salt."""

    name: str
    key: str
    version: str
    salt: str


class Answer(msgspec.Struct, frozen=True):
    """The answer of the server: its version, and the credentials for the node, or why it refuses the request."""

    version: str
    credentials: Credentials | None = None
    refusal: Message | None = None


def new_code() -> str:
    """Return a new code, such as K7QD-M2XF."""
    code = "".join(secrets.choice(ALPHABET) for _ in range(CODE_SIZE))
    return f"{code[: CODE_SIZE // 2]}-{code[CODE_SIZE // 2 :]}"


def short_key(key: str) -> str:
    """Return the end of a public key, by which people compare keys."""
    return f"{key[-8:-4]}-{key[-4:]}"


# -------------------------------------------------------------------------------------------------------- server
class Invitation:
    """The server's end of one pairing.

    Args:
        name: name of the node.
        accept: accepts the public key of a node at an address; returns its credentials.
        valid: time for which the code is valid, s.
        same_version: whether the node must run the version of the server.
    """

    def __init__(
        self,
        name: str,
        accept: Callable[[str, str], Credentials],
        valid: float = CODE_VALIDITY,
        *,
        same_version: bool = True,
    ) -> None:
        self.code = new_code()
        self._same_version = same_version
        self._name, self._accept, self._valid = name, accept, valid
        self._wrong = 0
        self._one_at_a_time = asyncio.Lock()
        self._certificate = b""
        self._outcome: asyncio.Future[str] = asyncio.get_running_loop().create_future()

    @contextlib.asynccontextmanager
    async def listening(self, host: str | None, port: int) -> AsyncIterator[int]:
        """Listen in this context; return the port.

        Args:
            host: address to listen on; None for all.
            port: 0 for a free one.

        Raises:
            OSError: the address cannot be used.
        """
        context, self._certificate = _server_context()
        server = await asyncio.start_server(
            self._serve, host, port, ssl=context, limit=_MAX_MESSAGE_SIZE, ssl_handshake_timeout=MESSAGE_TIMEOUT
        )
        async with server:
            yield server.sockets[0].getsockname()[1]

    async def wait_accepted(self) -> str:
        """Wait for the node; return its public key.

        Raises:
            Refused: the code expired, or was wrong too often.
            Arcor2Error: the node cannot be accepted.
        """
        await asyncio.wait({self._outcome}, timeout=self._valid)
        async with self._one_at_a_time:
            if not self._outcome.done():
                self._outcome.set_exception(Refused("The code has expired. Start again."))
            return await self._outcome

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        # A peer may send nothing, nonsense or too much, or close the connection.
        with contextlib.suppress(TimeoutError, OSError, EOFError, ValueError, msgspec.MsgspecError):
            async with asyncio.timeout(MESSAGE_TIMEOUT):
                proof, body = _split(await reader.readuntil())
            request = msgspec.json.decode(body, type=Request)
            async with self._one_at_a_time:
                if not self._outcome.done():
                    await self._handle(proof, body, request, writer)
        await _close(writer)

    async def _handle(self, proof: bytes, body: bytes, request: Request, writer: asyncio.StreamWriter) -> None:
        key = await asyncio.to_thread(_proof_key, self.code, request.salt, self._certificate)
        outcome: str | Arcor2Error | None
        if hmac.compare_digest(proof, _proof(key, b"node", body)):
            answer, outcome = self._answer(request, writer.get_extra_info("peername")[0])
        else:
            self._wrong += 1
            wrong = Refused("A wrong code was entered {count} times. Start again.", count=self._wrong)
            answer, outcome = Answer(own_version()), wrong if self._wrong >= MAX_ATTEMPTS else None
        content = msgspec.json.encode(answer)
        writer.write(_joined(_proof(key, b"server", body + content), content))
        await _close(writer)  # the answer is sent before the command ends
        if isinstance(outcome, Arcor2Error):
            self._outcome.set_exception(outcome)
        elif outcome is not None:
            self._outcome.set_result(outcome)

    def _answer(self, request: Request, address: str) -> tuple[Answer, str | Arcor2Error | None]:
        """Return the answer to a node that knows the code, and the outcome of the pairing."""
        if self._same_version and request.version != own_version():
            return Answer(own_version()), None
        if request.name != self._name or not is_user_key(request.key):
            refusal = Message.of("This code is for {name}.", name=self._name)
            return Answer(own_version(), refusal=refusal), None
        try:
            return Answer(own_version(), self._accept(request.key, address)), request.key
        except Arcor2Error as error:
            return Answer(own_version(), refusal=error.message), error


# -------------------------------------------------------------------------------------------------------- node
async def pair(
    name: str, host: str, port: int, code: str, *, command: str = "node", same_version: bool = True
) -> Credentials:
    """Create a key for a node and let the server accept it; return the credentials.

    Args:
        name: name of the node.
        host: address of the server.
        port: its port for pairing.
        code: the code that the server shows.
        command: the group of commands for messages.
        same_version: whether the server must run the version of the node.

    Raises:
        InvalidData: the text is not a name.
        ConnectionLost: the server cannot be reached.
        Refused: the code is wrong, or the server refuses the node.
        Arcor2Error: server and node have different versions.
    """
    check_name(name)
    key = SigningKey.create(Kind.USER)
    request = Request(name, key.public, own_version(), secrets.token_hex(16))
    body = msgspec.json.encode(request)
    address = f"{host}:{port}"
    try:
        async with asyncio.timeout(MESSAGE_TIMEOUT):
            reader, writer = await asyncio.open_connection(host, port, ssl=_client_context(), limit=_MAX_MESSAGE_SIZE)
        try:
            certificate = writer.get_extra_info("ssl_object").getpeercert(binary_form=True)
            secret = await asyncio.to_thread(_proof_key, _normalised_code(code), request.salt, certificate)
            writer.write(_joined(_proof(secret, b"node", body), body))
            async with asyncio.timeout(MESSAGE_TIMEOUT):
                proof, content = _split(await reader.readuntil())
        finally:
            await _close(writer)
    except (OSError, TimeoutError, EOFError, asyncio.LimitOverrunError) as error:
        raise ConnectionLost(
            "The server at {address} does not answer. Run `arcor2-hw {command} accept {name}` there first.",
            f"{type(error).__name__}: {error}",
            address=address,
            command=command,
            name=name,
        ) from error
    if not hmac.compare_digest(proof, _proof(secret, b"server", body + content)):
        raise Refused("The code is wrong, or the computer at {address} is not the server.", address=address)
    answer = msgspec.json.decode(content, type=Answer)
    refusal = (refusal_of(name, Opening("", answer.version)) if same_version else None) or answer.refusal
    if refusal is not None:
        raise Refused(refusal)
    if answer.credentials is None:
        raise Refused("The server refused the request.")
    return msgspec.structs.replace(answer.credentials, seed=key.seed)


# -------------------------------------------------------------------------------------------------------- both
def _normalised_code(code: str) -> str:
    """Return a code as typed in the form of `new_code`."""
    code = "".join(code.split()).replace("-", "").upper()
    return f"{code[: CODE_SIZE // 2]}-{code[CODE_SIZE // 2 :]}"


def _proof_key(code: str, salt: str, certificate: bytes) -> bytes:
    channel = hashlib.sha256(certificate).digest()
    return hashlib.scrypt(code.encode(), salt=salt.encode() + channel, n=_COST, r=8, p=1, maxmem=_MEMORY, dklen=32)


def _proof(key: bytes, sender: bytes, content: bytes) -> bytes:
    return hmac.digest(key, sender + b"\0" + content, "sha256")


def _joined(proof: bytes, content: bytes) -> bytes:
    return proof.hex().encode() + b" " + content + b"\n"


def _split(line: bytes) -> tuple[bytes, bytes]:
    """Return proof and content of a message. Raise ValueError if it is invalid."""
    proof, _, content = line.rstrip(b"\n").partition(b" ")
    return bytes.fromhex(proof.decode()), content


async def _close(writer: asyncio.StreamWriter) -> None:
    writer.close()
    with contextlib.suppress(OSError, TimeoutError):
        async with asyncio.timeout(CLOSE_TIMEOUT):
            await writer.wait_closed()


def _client_context() -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False  # the proofs authenticate the server
    context.verify_mode = ssl.CERT_NONE
    return context


def _server_context() -> tuple[ssl.SSLContext, bytes]:
    """Return a context with a new certificate, and the certificate."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "ARCOR2-HW pairing")])
    day = timedelta(days=1)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(datetime.now(UTC) - day)
        .not_valid_after(datetime.now(UTC) + day)
        .sign(key, hashes.SHA256())
    )
    pem = serialization.Encoding.PEM
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    with tempfile.NamedTemporaryFile() as file:  # the only form that ssl reads
        file.write(key.private_bytes(pem, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()))
        file.write(certificate.public_bytes(pem))
        file.flush()
        context.load_cert_chain(file.name)
    return context, certificate.public_bytes(serialization.Encoding.DER)
