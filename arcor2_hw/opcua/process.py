"""The process: builds the address space, follows the updates of the server, and passes requests of clients to it."""

import argparse
import asyncio
import contextlib
import faulthandler
import itertools
import logging
import os
import resource
import signal
import socket
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import msgspec
from asyncua import ua
from asyncua.crypto.uacrypto import load_certificate, load_private_key
from cryptography.hazmat.primitives import hashes

from arcor2_hw.data.alarms import AlarmRecord
from arcor2_hw.data.events import RobotJointsData
from arcor2_hw.data.points import ObjectPointsData
from arcor2_hw.framing import PREFIX_SIZE, body_length
from arcor2_hw.opcua import messages as m
from arcor2_hw.opcua.access import Internal, OpcUaServer, Services, caller
from arcor2_hw.opcua.certificates import TrustedClients, application_uri, own_certificate
from arcor2_hw.opcua.conditions import Conditions
from arcor2_hw.opcua.devices import Device
from arcor2_hw.opcua.space import Space
from arcor2_hw.opcua.unit import VENDOR, Unit

PATH: Final = "/arcor2hw/"
ANSWER_TIMEOUT: Final = 10.0
"""Time limit for an answer of the server, s."""
STALE_AFTER: Final = 3.0
"""Time without new values of a device after which they are stale, s."""
MOST_WAITING: Final = 4
"""Maximum number of updates that wait. Then nothing is read, and the server merges further changes."""
NICENESS: Final = 5
"""Scheduling priority below that of devices and the server."""


class _Points(msgspec.Struct):
    data: ObjectPointsData


class _Joints(msgspec.Struct):
    data: RobotJointsData


class _Head(msgspec.Struct):
    event: str


_decode_head: Final = msgspec.json.Decoder(_Head).decode
_decode_points: Final = msgspec.json.Decoder(_Points).decode
_decode_joints: Final = msgspec.json.Decoder(_Joints).decode


def main(arguments: Sequence[str]) -> int:
    """Serve until the socket with the given file descriptor is closed."""
    parser = argparse.ArgumentParser(prog="arcor2_hw.opcua")
    parser.add_argument("--fd", type=int, required=True)
    faulthandler.enable()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(OSError):
        os.nice(NICENESS)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is handled by the server, which ends this process
    logging.getLogger("asyncua").setLevel(logging.CRITICAL)  # it logs a stack trace for each broken connection
    with contextlib.suppress(asyncio.IncompleteReadError, ConnectionError):  # the server has ended
        asyncio.run(Process(parser.parse_args(arguments).fd).run())
    return 0


class Process:
    """The OPC UA server and its connection to our server."""

    def __init__(self, descriptor: int) -> None:
        self._socket = socket.socket(fileno=descriptor)
        self._numbers = itertools.count(1)
        self._answers: dict[int, asyncio.Future[Any]] = {}
        self._devices: dict[str, Device] = {}
        self._unit_data = m.UnitData()
        self._heard = time.monotonic()

    async def run(self) -> None:
        """Serve until the server closes the connection.

        Raises:
            IncompleteReadError: it has closed the connection.
        """
        self._reader, self._writer = await asyncio.open_unix_connection(sock=self._socket)
        setup = await self._read()
        await self._start(setup)
        watch = asyncio.create_task(self._watch())
        updates: asyncio.Queue[m.Update] = asyncio.Queue(MOST_WAITING)
        apply = asyncio.create_task(self._apply_all(updates))
        try:
            while True:
                message = await self._read()
                self._heard = time.monotonic()
                if isinstance(message, m.Update):
                    await updates.put(message)
                elif (answer := self._answers.pop(message.number, None)) is not None and not answer.done():
                    answer.set_result(message)
                if apply.done():
                    apply.result()
        finally:
            watch.cancel()
            apply.cancel()

    async def _read(self) -> Any:
        size = body_length(await self._reader.readexactly(PREFIX_SIZE), m.MAX_MESSAGE)
        return m.decode_to_process(await self._reader.readexactly(size))

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
        self._unit = Unit(space, setup, self._execute)
        await self._unit.add()
        await Conditions.prepare(server)
        self._conditions = Conditions(space, self._source, self._acknowledge)
        internal.acknowledge = self._conditions.acknowledge
        bound = socket.socket(fileno=setup.listener)
        bound.setblocking(False)
        await server.listen(bound)
        self._send(m.Started(certificate.fingerprint(hashes.SHA256()).hex(":").upper()))

    # -------------------------------------------------------------------------------- updates
    async def _apply_all(self, updates: "asyncio.Queue[m.Update]") -> None:
        while True:
            await self._apply(await updates.get())

    async def _apply(self, update: m.Update) -> None:
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

    async def _set_devices(self, devices: list[m.DeviceInfo]) -> None:
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
        if _decode_head(encoded).event == "RobotJoints":
            joints = _decode_joints(encoded).data
            if (device := self._devices.get(joints.robot_id)) is not None and joints.time_ms:
                await device.set_joints(joints.joints, joints.time_ms)
        else:
            points = _decode_points(encoded).data
            if (device := self._devices.get(points.object_id)) is not None and not points.reason:
                await device.set_points(points.points, points.time_ms)

    async def _watch(self) -> None:
        """Mark values as stale that are not renewed, also because the server does not answer."""
        while True:
            await asyncio.sleep(m.BEAT_PERIOD)
            silent = time.monotonic() - self._heard > STALE_AFTER
            for device in list(self._devices.values()):
                await device.expire(0.0 if silent else STALE_AFTER)

    def _source(self, alarm: AlarmRecord) -> tuple[ua.NodeId, str]:
        device = self._devices.get(alarm.object_id or "")
        if device is None:
            return self._unit.node, alarm.object_name or "Cell"
        return device.node, device.info.name

    # -------------------------------------------------------------------------------- requests
    def _send(self, message: m.FromProcess) -> None:
        self._writer.write(m.encode(message))

    async def _ask(self, message: Any) -> Any:
        answer = self._answers[message.number] = asyncio.get_running_loop().create_future()
        self._send(message)
        try:
            async with asyncio.timeout(ANSWER_TIMEOUT):
                return await answer
        finally:
            self._answers.pop(message.number, None)

    async def _check_user(self, name: str, secret: str, address: str) -> m.User | None:
        answer: m.LogOnAnswer = await self._ask(m.LogOn(next(self._numbers), name, secret, address))
        return answer.user

    async def _execute(self, command: int, job: int, request: str) -> m.CallAnswer:
        client = caller.get()
        if client is None or client.user is None:
            return m.CallAnswer(0, 1, "Log on with a user first.")
        message = m.Command(next(self._numbers), command, job, request, client.user, client.address)
        answer: m.CallAnswer = await self._ask(message)
        return answer

    async def _acknowledge(self, alarm: int, note: str) -> m.CallAnswer:
        client = caller.get()
        if client is None or client.user is None:
            return m.CallAnswer(0, 1, "Log on with a user first.")
        answer: m.CallAnswer = await self._ask(
            m.Acknowledge(next(self._numbers), alarm, note, client.user, client.address)
        )
        return answer
