"""Start the fake tightening controller: `python -m arcor2_fakes.screwdriver`."""

from __future__ import annotations

import sys
from datetime import datetime
from functools import partial
from typing import Annotated, Any

from cyclopts import Parameter, validators
from cyclopts.types import PositiveFloat

from arcor2_fakes.control import within
from arcor2_fakes.program import program
from arcor2_fakes.screwdriver.controller import Controller, Options
from arcor2_fakes.screwdriver.session import Session
from arcor2_fakes.screwdriver.tool import Alarm, Tool
from arcor2_fakes.serving import Fake
from arcor2_fakes.wire import TcpWire

Count = Annotated[int, Parameter(validator=validators.Number(gte=1, lte=99))]
Revision = Annotated[int, Parameter(validator=validators.Number(gte=0, lte=6))]


def truth(controller: Controller) -> dict[str, Any]:
    """Return the real state of controller and tool."""
    tool = controller.tool
    last = tool.last
    return {
        "enabled": tool.enabled,
        "running": tool.running,
        "program": tool.program,
        "job": tool.job,
        "made": tool.made,
        "pulls": tool.pulls,
        "last": None if last is None else {"ok": last.ok, "torque": last.torque, "angle": last.angle, "id": last.id},
        "alarm": None if tool.alarm is None else tool.alarm.code,
        "clients": sum(client.started for client in controller.clients),
        "subscribed": sum(client.results is not None for client in controller.clients),
        "unacknowledged": sum(client.unacknowledged for client in controller.clients),
        "received": list(controller.received),
    }


def register_commands(fake: Fake, controller: Controller, wire: TcpWire) -> None:
    """Register the commands of the control channel."""
    tool = controller.tool

    def pull(times: int = 1) -> None:
        tool.pull(within("times", times, 0, 1000))

    def tighten() -> None:
        """Tighten immediately, whether enabled or not, as by a test function of the controller."""
        tool.tighten_once()

    def alarm(
        code: str = "E404", text: str = "Tool overheated", controller_ready: bool = True, tool_ready: bool = False
    ) -> None:
        if not (1 <= len(code) <= 4 and code.isascii() and code.isalnum() and len(text) <= 50 and text.isascii()):
            raise ValueError("code has 1 to 4 letters and digits, text at most 50 ASCII characters")
        tool.raise_alarm(Alarm(code, text, bool(controller_ready), bool(tool_ready), datetime.now()))  # noqa: DTZ005

    def lose_acknowledgements(number: int = 1) -> None:
        """Lose the next acknowledgements of clients."""
        controller.deaf = within("number", number, 0, 100)

    def power_cycle() -> None:
        tool.power_on()
        wire.reset()

    async def renew() -> None:
        """Return to the state after the start, for tests that share a process."""
        await wire.fault("heal")
        wire.reset()
        tool.renew()
        controller.received.clear()
        controller.deaf, controller.commands_disabled, controller.tool_data_revision = 0, False, 2

    def tool_data_revision(revision: int) -> None:
        controller.tool_data_revision = int(revision)

    fake.switches(controller, disable_commands="commands_disabled")
    fake.commands(
        pull=pull,
        tighten=tighten,
        service=tool.service,
        tool_data_revision=tool_data_revision,
        plan=lambda torque, angle: tool.plan(float(torque), int(angle)),
        alarm=alarm,
        clear_alarm=tool.clear_alarm,
        lose_acknowledgements=lose_acknowledgements,
        power_cycle=power_cycle,
        renew=renew,
    )


@program("screwdriver", "Fake screwdriver on Open Protocol.")
async def main(
    fake: Fake,
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    duration: PositiveFloat = 1.0,
    evaluation: PositiveFloat = 0.05,
    time_scale: PositiveFloat = 1.0,
    automatic: bool = False,
    programs: Count = 10,
    jobs: Count = 5,
    clients: Count = 5,
    start_revision: Revision = 6,
    result_revision: Revision = 2,
    alarm_revision: Revision = 2,
    job_revision: Revision = 2,
    binary: bool = False,
    lock_on_loss: bool = False,
    response_timeout: PositiveFloat = 2.0,
    keep_alive_timeout: PositiveFloat = 15.0,
    seed: int = 0,
) -> None:
    """Start the fake; it prints one line `ready {json}` with its addresses and ends on SIGTERM.

    Args:
        host: address to serve Open Protocol on.
        port: port to serve Open Protocol on (4545 on real controllers); 0 takes a free one.
        duration: duration of a tightening, s.
        evaluation: time from its end to its result, s.
        time_scale: speed of the tool as a multiple of real time.
        automatic: hold the trigger, so that an enabled tool tightens again and again.
        programs: number of programs.
        jobs: number of jobs.
        clients: number of clients that may be connected at the same time.
        start_revision: highest revision of MID 0002.
        result_revision: highest revision of MID 0061, 1 or 2.
        alarm_revision: highest revision of MID 0071, 1 or 2; 0: no alarms.
        job_revision: highest revision of MID 0038, 1 or 2.
        binary: send the bit fields of results as bytes, as older controllers do.
        lock_on_loss: disable the tool when a client is lost.
        response_timeout: time in which a client has to acknowledge an event, s.
        keep_alive_timeout: time without a message after which a client is disconnected, s.
        seed: seed of torque and angle.
    """
    tool = Tool(
        programs=programs,
        jobs=jobs,
        duration=duration / time_scale,
        evaluation=evaluation / time_scale,
        automatic=automatic,
        seed=seed,
    )
    options = Options(
        clients=clients,
        start_revision=start_revision,
        result_revision=result_revision,
        alarm_revision=alarm_revision,
        job_revision=job_revision,
        binary=binary,
        lock_on_loss=lock_on_loss,
    )
    controller = Controller(tool, options, response_timeout=response_timeout, keep_alive_timeout=keep_alive_timeout)
    wire = TcpWire("open_protocol", host, port, partial(Session, controller))
    register_commands(fake, controller, wire)
    fake.wires(open_protocol=wire)
    fake.truth(lambda: truth(controller))
    await fake.run(open_protocol=wire)


if __name__ == "__main__":
    sys.exit(main())
