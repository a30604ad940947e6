"""Start the fake PLC: `python -m arcor2_fakes.opcua_plc`."""

from __future__ import annotations

import asyncio
import gc
import logging
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, cast

from asyncua import Server, ua
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.user_managers import UserManager
from cyclopts.types import PositiveFloat

from arcor2_fakes.control import parse_address, within
from arcor2_fakes.opcua_plc.program import Host, Program, Step
from arcor2_fakes.opcua_plc.proxy import Proxy
from arcor2_fakes.opcua_plc.space import OFF_ON_LOSS, POINTS, Space
from arcor2_fakes.process import OwnTime
from arcor2_fakes.program import program
from arcor2_fakes.serving import Fake

SCAN = 0.01
"""Time between scans, s."""
JOBS = {1: 1.0, 2: 3.0, 3: 20.0}
"""Duration of each job, s, before the time scale."""


class OneUser(UserManager):
    """Accepts one user by password; with an empty name everybody."""

    def __init__(self, name: str, password: str) -> None:
        self._name, self._password = name, password

    def get_user(
        self,
        iserver: Any,  # noqa: ARG002 - the stack's signature
        username: str | None = None,
        password: str | None = None,
        certificate: Any = None,  # noqa: ARG002
    ) -> User | None:
        """Return the user; None: rejected."""
        if not self._name or (username, password) == (self._name, self._password):
            return User(role=UserRole.User)
        return None


class Plc:
    """The PLC: its program and its variables."""

    def __init__(self, server: Server, program: Program) -> None:
        self.space, self.program = Space(server), program
        self.cycles = 0

    async def run(self) -> None:
        """Scan periodically."""
        own_time = OwnTime()
        own_time.run()
        while True:
            await self.scan(own_time())
            await asyncio.sleep(SCAN)

    async def scan(self, time: float) -> None:
        """Read the variables of the host, run the program, and write its variables."""
        space, program = self.space, self.program
        names = ("Owner", "HostLife", "Number", "Request")
        gone = program.scan(Host(*(space.value(f"Handshake.{name}") for name in names)), time)
        if gone:
            await space.set("Handshake.Owner", 0)
            for name in OFF_ON_LOSS:
                await space.set(f"Cell.{name}", POINTS[name][2])
        await space.set("Handshake.PlcLife", program.life)
        # Busy falls last: a client that sees it fall can read the result of the job.
        await space.set("Handshake.Code", program.code)
        await space.set("Handshake.Done", program.step is Step.DONE)
        await space.set("Handshake.Error", program.step is Step.ERROR)
        await space.set("Handshake.Busy", program.moving)
        self.cycles += 1

    def truth(self) -> dict[str, Any]:
        """Return the real state of the PLC."""
        program, space = self.program, self.space
        return {
            "step": program.step.value,
            "moving": program.moving,
            "code": program.code,
            "done": list(program.done),
            "owner": space.value("Handshake.Owner"),
            "host_life": space.value("Handshake.HostLife"),
            "points": {name: space.value(f"Cell.{name}") for name in POINTS},
            "writes": len(space.written),
            "written": space.written[-100:],
            "cycles": self.cycles,
        }

    async def restart(self) -> None:
        """Restart, as after power-on."""
        self.program.restart()
        for name in ("Owner", "HostLife", "Number"):
            await self.space.set(f"Handshake.{name}", 0)
        await self.space.set("Handshake.Request", False)
        for name, (_, _, value) in POINTS.items():
            await self.space.set(f"Cell.{name}", value, 0)


def register_commands(fake: Fake, plc: Plc, proxy: Proxy) -> None:
    """Register the commands of the control channel."""
    program, space = plc.program, plc.space

    async def set_point(name: str, value: Any) -> None:
        await space.set(f"Cell.{name}", value)

    async def quality(name: str, status: str) -> None:
        code = 0 if status == "Good" else int(getattr(ua.StatusCodes, status))
        await space.set(f"Cell.{name}", space.value(f"Cell.{name}"), code)

    async def stranger(number: int) -> None:
        program.stranger = number > 0
        await space.set("Handshake.Owner", int(number))

    def job_error(code: int) -> None:
        program.next_error = int(code)

    async def power_cycle(seconds: float = 0.5) -> None:
        within("seconds", seconds, 0, 60)
        proxy.wire.refuse()
        proxy.wire.reset()
        await plc.restart()
        await asyncio.sleep(seconds)
        await proxy.wire.fault("heal")

    fake.switches(program, stuck="stuck", deaf="deaf", live="live")
    fake.commands(
        set=set_point,
        quality=quality,
        stranger=stranger,
        job_error=job_error,
        remove=lambda name: space.remove(f"Cell.{name}"),
        restart=plc.restart,
        power_cycle=power_cycle,
    )


async def make_server(user: str, password: str, certificate: Path | None, key: Path | None) -> Server:
    """Return the OPC UA stack on a free port; it is not started."""
    server = Server(user_manager=OneUser(user, password) if user else None)
    gc.disable()  # it would visit the 700,000 objects of the address space repeatedly while they are created
    await server.init()
    gc.freeze()
    gc.enable()
    server.set_endpoint("opc.tcp://127.0.0.1:0")
    server.set_server_name("Fake PLC")
    await server.set_build_info("urn:arcor2-hw:fake-plc", "ARCOR2-HW", "Fake PLC 1500", "2.9", "7", datetime.now(UTC))
    policies = [ua.SecurityPolicyType.NoSecurity]
    if certificate is not None and key is not None:
        await server.load_certificate(certificate)
        await server.load_private_key(key, format="pem")
        policies = [
            ua.SecurityPolicyType.Basic256Sha256_Sign,
            ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
        ]
    server.set_security_policy(policies)
    return server


@program("opcua_plc", "Fake PLC with an OPC UA server.")
async def main(
    fake: Fake,
    *,
    listen: str = "127.0.0.1:0",
    time_scale: PositiveFloat = 1.0,
    patience: PositiveFloat = 1.0,
    user: str = "",
    password: str = "",
    certificate: Path | None = None,
    key: Path | None = None,
) -> None:
    """Start the fake; it prints one line `ready {json}` with its URL and ends on SIGTERM.

    Args:
        listen: HOST:PORT of the OPC UA server; port 0 takes a free one.
        time_scale: how many times faster than real time the jobs are.
        patience: time without a life sign after which the host counts as disconnected, s; not scaled.
        user: name of the only accepted user; empty for everybody.
        password: password of that user.
        certificate: PEM or DER file; the server then accepts only signed and encrypted connections.
        key: PEM file of the certificate's private key.
    """
    logging.getLogger("asyncua").setLevel(logging.CRITICAL)  # broken connections are expected
    server = await make_server(user, password, certificate, key)
    jobs = {number: seconds / time_scale for number, seconds in JOBS.items()}
    plc = Plc(server, Program(jobs, 0.1 / time_scale, patience))
    await plc.space.build()
    await server.start()
    inner = cast("Any", server.bserver)._server.sockets[0].getsockname()[1]
    proxy = Proxy(*parse_address(listen), inner)
    register_commands(fake, plc, proxy)
    fake.wires(opcua=proxy.wire)
    fake.truth(plc.truth)
    fake.background(plc.run())
    fake.at_end(proxy.close)
    fake.at_end(server.stop)
    await fake.run(url=lambda: f"opc.tcp://{proxy.wire.address}")


if __name__ == "__main__":
    sys.exit(main())
