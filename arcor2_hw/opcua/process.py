"""The process: builds the address space, follows the updates of the server, and passes requests of clients to it."""

import asyncio
import gc
import itertools
import logging
import socket
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from asyncua import ua
from asyncua.crypto.uacrypto import load_certificate, load_private_key
from cryptography.hazmat.primitives import hashes

from arcor2_hw.data.alarms import AlarmRecord
from arcor2_hw.data.events import RobotJointsData
from arcor2_hw.opcua import messages as m
from arcor2_hw.opcua.access import Internal, OpcUaServer, Services, caller
from arcor2_hw.opcua.certificates import TrustedClients, application_uri, own_certificate
from arcor2_hw.opcua.conditions import Conditions
from arcor2_hw.opcua.devices import Device
from arcor2_hw.opcua.monitored_devices import MonitoredDevices
from arcor2_hw.opcua.space import Space
from arcor2_hw.opcua.unit import VENDOR, Unit
from arcor2_hw.plant.messages import BEAT_PERIOD, STALE_AFTER, DeviceInfo, UnitData, Update
from arcor2_hw.plant.process import ServerLink, run_until_closed
from arcor2_hw.plant.streams import decode_stream

PATH: Final = "/arcor2hw/"
ANSWER_TIMEOUT: Final = 10.0
"""Time limit for an answer of the server, s."""
MAX_WAITING: Final = 4
"""Maximum number of updates that wait. Then nothing is read, and the server merges further changes."""


def main(arguments: Sequence[str]) -> int:
    """Serve until the socket with the given file descriptor is closed."""
    logging.getLogger("asyncua").setLevel(logging.CRITICAL)  # it logs a stack trace for each broken connection
    return run_until_closed("arcor2_hw.opcua", arguments, lambda descriptor: Process(descriptor).run())


class Process:
    """The OPC UA server and its connection to our server."""

    def __init__(self, descriptor: int) -> None:
        self._link = ServerLink(descriptor, m.decode_to_process)
        self._numbers = itertools.count(1)
        self._answers: dict[int, asyncio.Future[Any]] = {}
        self._devices: dict[str, Device] = {}
        self._interest = MonitoredDevices(self._devices, lambda devices: self._link.send(m.Watch(devices)))
        self._unit_data = UnitData()
        self._heard = time.monotonic()

    async def run(self) -> None:
        """Serve until the server closes the connection.

        Raises:
            IncompleteReadError: it has closed the connection.
        """
        await self._link.open()
        setup = await self._link.read()
        gc.disable()  # the collector would visit 700,000 objects repeatedly during their creation
        await self._start(setup)
        gc.freeze()
        gc.enable()
        watch = asyncio.create_task(self._watch())
        updates: asyncio.Queue[Update] = asyncio.Queue(MAX_WAITING)
        apply = asyncio.create_task(self._apply_all(updates))
        try:
            while True:
                message = await self._link.read()
                self._heard = time.monotonic()
                if isinstance(message, Update):
                    await updates.put(message)
                elif (answer := self._answers.pop(message.number, None)) is not None and not answer.done():
                    answer.set_result(message)
                if apply.done():
                    apply.result()
        finally:
            watch.cancel()
            apply.cancel()

    async def _start(self, setup: m.Setup) -> None:
        folder = Path(setup.folder)
        files = own_certificate(folder, setup.machine, setup.hosts)
        internal = Internal(
            TrustedClients(folder),
            self._check_user,
            anonymous=setup.anonymous,
            unencrypted=setup.unencrypted,
        )
        server = self._server = OpcUaServer(iserver=internal)
        await server.init()
        server.product_uri, server.manufacturer_name = "urn:arcor2-hw", VENDOR
        server.set_server_name(f"ARCOR2-HW: {setup.cell}")
        server.application_type = ua.ApplicationType.Server
        await server.set_application_uri(application_uri(setup.machine))
        await server.set_build_info("urn:arcor2-hw", VENDOR, "ARCOR2-HW", setup.version, "", datetime.now(UTC))
        certificate = await load_certificate(files[0])
        internal.certificate, internal.private_key = certificate, await load_private_key(files[1])
        host = f"[{setup.host}]" if ":" in setup.host else setup.host
        server.set_endpoint(f"opc.tcp://{host}:{setup.port}{PATH}")
        policies = [ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt]
        if setup.unencrypted:
            policies.append(ua.SecurityPolicyType.NoSecurity)
        server.set_security_policy(policies, permission_ruleset=Services())  # type: ignore[arg-type]
        space = self._space = Space(server)
        await space.load()
        self._unit = Unit(space, setup, self._execute, self._set_mode)
        await self._unit.add()
        await Conditions.prepare(server)
        self._conditions = Conditions(space, self._source, self._acknowledge)
        internal.acknowledge, internal.interest = self._conditions.acknowledge, self._interest
        bound = socket.socket(fileno=setup.listener)
        bound.setblocking(False)
        await server.listen(bound)
        self._link.send(m.Started(certificate.fingerprint(hashes.SHA256()).hex(":").upper()))

    # -------------------------------------------------------------------------------- updates
    async def _apply_all(self, updates: "asyncio.Queue[Update]") -> None:
        while True:
            await self._apply(await updates.get())

    async def _apply(self, update: Update) -> None:
        if update.devices is not None:
            await self._set_devices(update.devices)
        for key, state in update.states.items():
            if (device := self._devices.get(key)) is not None:
                await device.set_state(state)
        for encoded in update.streams:
            await self._stream(encoded)
        if update.unit is not None:
            self._unit_data = update.unit
            await self._unit.set(update.unit)
        if update.unit is not None or update.devices is not None:
            for device in self._devices.values():
                if device.robot is not None:
                    await device.robot.set_program(self._unit_data)
        for alarm in update.alarms:
            await self._conditions.change(alarm)
        if update.alarms:
            await self._unit.set_stop_reason(list(self._conditions.retained.values()))

    async def _set_devices(self, devices: list[DeviceInfo]) -> None:
        wanted = {info.id: info for info in devices}
        for key, device in list(self._devices.items()):
            if wanted.get(key) != device.info:
                await device.remove()
                del self._devices[key]
        for key, info in wanted.items():
            if key not in self._devices:
                self._devices[key] = Device(self._space, info)
                await self._devices[key].add(self._unit.components)

    async def _stream(self, encoded: bytes) -> None:
        data = decode_stream(encoded)
        if isinstance(data, RobotJointsData):
            if (device := self._devices.get(data.robot_id)) is not None and data.time_ms:
                await device.set_joints(data.joints, data.time_ms)
                self._interest.arrived(device.nodes[-1])
        elif (device := self._devices.get(data.object_id)) is not None:
            if not data.reason:
                await device.set_points(data.points, data.time_ms)
            self._interest.arrived(device.node)

    async def _watch(self) -> None:
        """Mark values as stale if they are not renewed, also if the server does not answer."""
        clients = 0
        while True:
            self._interest.update()
            listener = self._server.bserver
            if (count := len(listener.clients) if listener else 0) != clients:
                clients = count
                self._link.send(m.Clients(clients))
            await asyncio.sleep(BEAT_PERIOD)
            silent = time.monotonic() - self._heard > STALE_AFTER
            for device in list(self._devices.values()):
                await device.expire(0.0 if silent else STALE_AFTER)

    def _source(self, alarm: AlarmRecord) -> tuple[ua.NodeId, str]:
        device = self._devices.get(alarm.object_id or "")
        if device is None:
            return self._unit.node, alarm.object_name or "Cell"
        return device.node, device.info.name

    # -------------------------------------------------------------------------------- requests
    async def _ask(self, message: Any) -> Any:
        answer = self._answers[message.number] = asyncio.get_running_loop().create_future()
        self._link.send(message)
        try:
            async with asyncio.timeout(ANSWER_TIMEOUT):
                return await answer
        finally:
            self._answers.pop(message.number, None)

    async def _check_user(self, name: str, secret: str, address: str) -> m.User | None:
        answer: m.LogOnAnswer = await self._ask(m.LogOn(next(self._numbers), name, secret, address))
        return answer.user

    async def _ask_as_user(self, message: Callable[[int, m.User, str], Any]) -> m.CallAnswer:
        """Send a request of the calling client. `message`: makes it from its number, the user and the address."""
        client = caller.get()
        if client is None or client.user is None:
            return m.CallAnswer(0, 1, "Log on with a user first.")
        answer: m.CallAnswer = await self._ask(message(next(self._numbers), client.user, client.address))
        return answer

    async def _execute(self, command: int, job: int, request: str) -> m.CallAnswer:
        return await self._ask_as_user(
            lambda number, user, address: m.Command(number, command, job, request, user, address)
        )

    async def _set_mode(self, mode: int) -> m.CallAnswer:
        return await self._ask_as_user(lambda number, user, address: m.SetMode(number, mode, user, address))

    async def _acknowledge(self, alarm: int, note: str) -> m.CallAnswer:
        return await self._ask_as_user(lambda number, user, address: m.Acknowledge(number, alarm, note, user, address))
