"""Link: a connection to an OPC UA server, by the client of asyncua on its own thread and event loop."""

import asyncio
import concurrent.futures
import contextlib
import logging
import threading
from collections.abc import Callable, Coroutine, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, TypeVar

from asyncua import Client, ua
from asyncua.common.subscription import DataChangeNotif
from asyncua.crypto import security_policies, uacrypto
from cryptography import x509

from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault, DeviceTimeout, NotConnected, Refused
from arcor2_hw.keep_alive import awaited_within, result_within
from arcor2_hw.messages import Message, device_at

from .settings import OpcUaPlcSettings, Security

T = TypeVar("T")

PUBLISHING: Final = 50.0
"""Time between two messages of the subscription, ms."""
SAMPLING: Final = 20.0
"""Sampling period of the server, ms."""
KEEP_ALIVE: Final = 10
"""Number of publishing intervals after which a subscription without changes sends a keep-alive."""
LIFETIME: Final = 200
"""Number of publishing intervals without a request after which the server ends the subscription."""
QUEUE: Final = 32
"""Number of changes of a value that the server queues between two messages."""
SESSION: Final = 30_000
"""Time without a request after which the server ends the session, ms."""
CLOSE_TIMEOUT: Final = 0.3
"""Time limit for closing the session, s."""
LIBRARY_PATIENCE: Final = 4.0
"""Factor on the time limit of a request, for the library: it also counts stalls of this process, then disconnects."""
JOIN: Final = 1.0

_POLICIES: Final[dict[str, Any]] = {
    "basic256sha256": security_policies.SecurityPolicyBasic256Sha256,
    "aes128_sha256": security_policies.SecurityPolicyAes128Sha256RsaOaep,
    "aes256_sha256": security_policies.SecurityPolicyAes256Sha256RsaPss,
}
_BROKEN: Final = ("BadConnection", "BadSession", "BadSecureChannel", "BadServerNotConnected", "BadTcp", "BadShutdown")
"""Prefixes of the names of statuses that mean a broken connection."""
_UNAUTHORIZED: Final = ("BadUserAccessDenied", "BadIdentityToken", "BadCertificate", "BadSecurity")
"""Prefixes of the names of statuses that mean rejected credentials."""

Changed = Callable[[str, ua.DataValue], None]


def status_name(value: ua.DataValue) -> str:
    """Return the name of a value's status."""
    return "Good" if value.StatusCode is None else str(value.StatusCode.name)


# asyncua logs a stack trace for each broken connection; here it is raised as a typed error.
logging.getLogger("asyncua").setLevel(logging.CRITICAL)


class _Handler:
    """Receives notifications of the subscription, on the thread of the link."""

    def __init__(self, names: Mapping[ua.NodeId, list[str]], changed: Changed) -> None:
        self._names, self._changed = names, changed

    def datachange_notification(self, node: Any, val: Any, data: DataChangeNotif) -> None:
        """Report a new value for each name of its node."""
        for name in self._names.get(node.nodeid, ()):
            self._changed(name, data.monitored_item.Value)

    def status_change_notification(self, status: ua.StatusChangeNotification) -> None:
        """Ignore the end of the subscription by the server; `Link.broken` detects it."""


class _Loop(asyncio.SelectorEventLoop):
    """An event loop that can close the connections that were opened in it."""

    def __init__(self) -> None:
        super().__init__()
        self._opened: list[asyncio.Transport] = []

    async def create_connection(self, *arguments: Any, **options: Any) -> Any:
        """Open a connection and record it."""
        opened = await super().create_connection(*arguments, **options)
        self._opened.append(opened[0])
        return opened

    def abort(self) -> None:
        """Close all connections, also those that asyncua does not close because they opened after its timeout."""
        for transport in self._opened:
            transport.abort()


class Link:
    """A connection to a server.

    Args:
        name: Name of the PLC, for errors.
        settings: The settings.
        nodes: Node ids by name.
        watched: Names to subscribe to.
        changed: Called on the thread of the link with each new value of a watched name.
    """

    def __init__(
        self, name: str, settings: OpcUaPlcSettings, nodes: Mapping[str, str], watched: Sequence[str], changed: Changed
    ) -> None:
        self.who: str | Message = device_at(name, settings.url)
        self.nodes = {name: ua.NodeId.from_string(text) for name, text in nodes.items()}
        self._settings, self._watched, self._changed = settings, watched, changed
        self._sending = threading.Lock()
        self._loop: _Loop | None = None
        self._thread: threading.Thread | None = None
        self._client: Client | None = None
        self._subscription: Any = None
        self._up = False

    # -------------------------------------------------------------------------------- connection
    def _run(self, loop: _Loop) -> None:
        asyncio.set_event_loop(loop)
        try:
            loop.run_forever()
        finally:
            left = asyncio.all_tasks(loop)
            for task in left:
                task.cancel()
            loop.run_until_complete(asyncio.gather(*left, return_exceptions=True))
            loop.abort()
            loop.run_until_complete(loop.shutdown_default_executor())
            loop.close()

    def open(self, timeout: float) -> None:
        """Open a session. Raises NotConnected, DeviceTimeout, Refused, DeviceFault."""
        self._client = self._subscription = None
        self._loop = _Loop()
        self._thread = threading.Thread(target=self._run, args=(self._loop,), name=f"OPC UA {self.who}", daemon=True)
        self._thread.start()
        try:
            self._call(self._connect, timeout, f"connecting within {timeout:.1f} s")
        except ConnectionLost as e:
            raise NotConnected("{device} cannot be reached", e.detail, device=self.who) from e
        self._up = True

    async def _connect(self) -> None:
        settings = self._settings
        client = Client(settings.url, timeout=LIBRARY_PATIENCE * settings.request_timeout)
        client.session_timeout = SESSION
        client.name = client.description = "ARCOR2-HW"
        self._client = client
        if settings.user:
            client.set_user(settings.user)
            client.set_password(await asyncio.to_thread(_password, self.who, settings.password_file))
        if settings.security is not Security.NONE:
            await self._secure(client)
        await client.connect()

    def watch(self) -> None:
        """Subscribe to the values of the watched names. Raises DeviceTimeout, ConnectionLost, DeviceFault."""
        self._call(self._subscribe, 2.0 * self._settings.request_timeout, "subscribing")

    async def _subscribe(self) -> None:
        client = self._client
        assert client is not None
        parameters = ua.CreateSubscriptionParameters()
        parameters.RequestedPublishingInterval = PUBLISHING
        parameters.RequestedMaxKeepAliveCount = ua.UInt32(KEEP_ALIVE)
        parameters.RequestedLifetimeCount = ua.UInt32(LIFETIME)
        names: dict[ua.NodeId, list[str]] = {}
        for name in self._watched:
            names.setdefault(self.nodes[name], []).append(name)
        self._subscription = await client.create_subscription(parameters, _Handler(names, self._changed))
        made = await self._subscription.subscribe_data_change(
            [client.get_node(node) for node in names], queuesize=QUEUE, sampling_interval=SAMPLING
        )
        for node, result in zip(names, made, strict=True):
            if isinstance(result, ua.StatusCode):
                raise DeviceFault(
                    "{device}: {name} ({to_string}) {result_name}",
                    "",
                    result.name,
                    device=self.who,
                    name=names[node][0],
                    to_string=node.to_string(),
                    result_name=result.name,
                )

    async def _secure(self, client: Client) -> None:
        settings = self._settings
        policy, _, mode = settings.security.rpartition("_")
        try:
            names = (settings.client_certificate, settings.client_key, settings.server_certificate)
            ours, key, theirs = [await asyncio.to_thread(_properties, name) for name in names]
            content = ours.path_or_content
            assert isinstance(content, bytes)
            load = x509.load_pem_x509_certificate if b"-----BEGIN" in content else x509.load_der_x509_certificate
            others = load(content).extensions.get_extension_for_class(x509.SubjectAlternativeName).value
            uris = others.get_values_for_type(x509.UniformResourceIdentifier)
            client.application_uri = uris[0] if uris else client.application_uri  # a server compares the two endpoints
            await client.set_security(
                _POLICIES[policy],
                ours,
                key,
                server_certificate=theirs,
                mode=ua.MessageSecurityMode.Sign if mode == "sign" else ua.MessageSecurityMode.SignAndEncrypt,
            )
        except (OSError, ValueError, TypeError, x509.ExtensionNotFound) as e:
            text = "{device}: client_certificate, client_key or server_certificate cannot be used"
            raise NotConnected(text, str(e), device=self.who) from e

    def close(self) -> None:
        """Close the connection. Waiting calls end with ConnectionLost. Do nothing if it is closed."""
        thread, self._thread = self._thread, None
        if thread is None:
            return
        up, self._up = self._up, False
        with contextlib.suppress(DeviceError):
            self._call(lambda: self._leave(up), 2.0 * CLOSE_TIMEOUT, "leaving")
        with self._sending:  # earlier requests are cancelled, later ones fail at once
            loop, self._loop = self._loop, None
            if loop is not None:
                loop.call_soon_threadsafe(loop.stop)
        thread.join(JOIN)

    async def _leave(self, up: bool) -> None:
        client = self._client
        if client is None:
            return
        try:
            if up and not self.broken:
                async with asyncio.timeout(CLOSE_TIMEOUT):
                    await client.close_session()
                    await client.close_secure_channel()
        except (TimeoutError, OSError, ua.UaError):
            pass  # the server ends the session after SESSION
        finally:
            client.disconnect_socket()

    @property
    def broken(self) -> bool:
        """Return whether the subscription has ended."""
        subscription = self._subscription
        return subscription is not None and bool(subscription.is_stale(3.0))

    # -------------------------------------------------------------------------------- requests
    def read(self, names: Sequence[str], attribute: Any = ua.AttributeIds.Value) -> list[ua.DataValue]:
        """Read values. Raises DeviceTimeout, ConnectionLost, DeviceFault."""

        async def ask() -> list[ua.DataValue]:
            found: list[ua.DataValue] = await self._session().read_attributes(
                [self.nodes[name] for name in names], attribute
            )
            return found

        return self._call(ask, self._settings.request_timeout, f"reading {', '.join(names[:5])}")

    def read_standard(self, number: int) -> Any:
        """Read a variable of the standard (OPC 10000-5) by its number."""

        async def ask() -> Any:
            (found,) = await self._session().read_attributes([ua.NodeId(ua.Int32(number))], ua.AttributeIds.Value)
            return None if found.Value is None else found.Value.Value

        return self._call(ask, self._settings.request_timeout, "reading about itself")

    def write(self, values: Mapping[str, ua.Variant], timeout: float = 0.0) -> None:
        """Write values in order in one request. Raises Refused, which names the rejected value."""

        async def ask() -> list[ua.StatusCode]:
            given = [ua.DataValue(value) for value in values.values()]
            found: list[ua.StatusCode] = await self._session().write_attributes(
                [self.nodes[name] for name in values], given, ua.AttributeIds.Value
            )
            return found

        limit = timeout or self._settings.request_timeout
        for name, status in zip(values, self._call(ask, limit, f"writing {', '.join(values)}"), strict=True):
            if not status.is_good():
                raise Refused(
                    "{device}: writing {name} ({to_string}): {status_name}",
                    status.name,
                    device=self.who,
                    name=name,
                    to_string=self.nodes[name].to_string(),
                    status_name=status.name,
                )

    def _session(self) -> Any:
        if self._client is None:
            raise NotConnected("{device} is not connected", device=self.who)
        return self._client.uaclient

    def _call(self, work: Callable[[], Coroutine[Any, Any, T]], timeout: float, operation: str) -> T:
        async def limited() -> T:
            return await awaited_within(work(), timeout)

        with self._sending:
            if self._loop is None:
                raise ConnectionLost("{device}: the connection was closed", device=self.who)
            future = asyncio.run_coroutine_threadsafe(limited(), self._loop)
        try:
            return result_within(future, timeout + JOIN)
        except DeviceError:
            raise
        except TimeoutError as e:  # the future's own and asyncio's are the same class
            future.cancel()
            raise DeviceTimeout(
                "{device}: {what}: no answer within {timeout:g} s",
                str(e),
                device=self.who,
                what=operation,
                timeout=timeout,
            ) from e
        except (concurrent.futures.CancelledError, OSError) as e:
            raise ConnectionLost(
                "{device}: {what}: the connection broke", str(e), device=self.who, what=operation
            ) from e
        except ua.UaStatusCodeError as e:
            raise self._typed(type(e).__name__, operation, e) from e
        except ua.UaError as e:
            raise ConnectionLost(
                "{device}: {what}: invalid answer", f"{type(e).__name__}: {e}", device=self.who, what=operation
            ) from e

    def _typed(self, name: str, operation: str, error: Exception) -> DeviceError:
        if name == "BadTimeout" or name == "BadRequestTimeout":
            return DeviceTimeout("{device}: {what}: no answer in time", str(error), device=self.who, what=operation)
        if name.startswith(_BROKEN):
            return ConnectionLost("{device}: {what}: the connection broke", str(error), device=self.who, what=operation)
        if name.startswith(_UNAUTHORIZED):
            return Refused("{device} rejected the credentials: {name}", str(error), device=self.who, name=name)
        return DeviceFault("{device}: {what}: {name}", str(error), name, device=self.who, what=operation, name=name)


def _properties(file: str) -> uacrypto.CertProperties:
    """Return the content of a certificate or key file with its format, which asyncua would guess from the name."""
    content = Path(file).read_bytes()
    return uacrypto.CertProperties(content, extension="pem" if b"-----BEGIN" in content else "der")


def _password(who: str | Message, file: str) -> str:
    try:
        return Path(file).read_text("utf-8").rstrip("\r\n")
    except (OSError, ValueError) as e:
        raise NotConnected("{device}: password_file cannot be read", str(e), device=who) from e
