"""Control session: the connections to the motion servers of both arms, and the RAPID commands around them."""

import logging
import math
import threading
import time
from typing import Final

from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import DeviceError, DeviceTimeout, Refused
from arcor2_hw.keep_alive import once_within

from .arm_line import ArmLine
from .frames import orientation_values, position_values
from .motion_lines import Code
from .rws import Rws
from .settings import ARMS, YumiSettings

LISTEN_TIMEOUT: Final = 2.0
"""Time for the servers to listen after the program was started, s."""
POLL_INTERVAL: Final = 0.05
"""Time between two readings of a value that is awaited, s."""

log = logging.getLogger(__name__)

Load = tuple[float, tuple[float, float, float]]


class ControlSession:
    """Control of both arms. `ended` is None or the reason of its end; `ended_at` is the time of the end (monotonic)."""

    def __init__(self, name: str, settings: YumiSettings) -> None:
        self.name = name
        self.ended: DeviceError | None = None
        self.ended_at = math.inf
        self.lines = {arm: ArmLine(name, arm, settings.host, settings.port(arm), self._line_ended) for arm in ARMS}
        self._settings = settings
        self._ending = threading.Lock()

    def open(self) -> None:
        """Connect to both servers and start their sessions. Raise DeviceError."""
        for line in self.lines.values():
            line.open(LISTEN_TIMEOUT, self._settings.watchdog)

    def set_tool(self, arm: str, tcp: Pose, load: Load) -> None:
        """Set the tool of an arm."""
        line = self.lines[arm]
        line.ask(Code.TOOL, *position_values(tcp), *orientation_values(tcp))
        line.ask(Code.LOAD, load[0], *(value * 1e3 for value in load[1]))

    def end(self, reason: DeviceError, wait: bool = True) -> None:
        """End the session, unless it has ended; the servers stop their arms."""
        with self._ending:
            if self.ended is None:
                self.ended, self.ended_at = reason, time.monotonic()
        for line in self.lines.values():
            line.end(reason, wait)

    def _line_ended(self, reason: DeviceError) -> None:
        first = self.ended is None
        self.end(reason, wait=False)
        if first:
            log.warning("%s: control ended: %s", self.name, reason)


def request_mastership(rws: Rws, domain: str) -> None:
    """Take mastership of a domain. Raise Refused, with the controller's text."""
    rws.act(f"/rw/mastership/{domain}", "request")


def release_mastership(rws: Rws, domain: str) -> bool:
    """Release mastership of a domain, if we have it. Return whether the controller confirmed it."""
    try:
        rws.act(f"/rw/mastership/{domain}", "release")
    except Refused:
        return True
    except DeviceError:
        return False
    return True


def await_value(rws: Rws, path: str, field: str, value: str, within: float, name: str) -> None:
    """Wait until a field of a resource has a value. Raise DeviceTimeout; `name` names the expected action."""
    if not once_within(lambda: rws.value(path, field) == value, within, POLL_INTERVAL):
        raise DeviceTimeout("{device} did not {what} within {limit:g} s.", device=rws.who, what=name, limit=within)


def start_rapid(rws: Rws) -> None:
    """Start RAPID from main in all tasks, which drops an interrupted motion. Needs mastership."""
    rws.act("/rw/rapid/execution", "resetpp", timeout=2.0)
    rws.act(
        "/rw/rapid/execution",
        "start",
        {
            "regain": "continue",
            "execmode": "continue",
            "cycle": "forever",
            "condition": "none",
            "stopatbp": "disabled",
            "alltaskbytsp": "false",
        },
        2.0,
    )
    await_value(rws, "/rw/rapid/execution", "ctrlexecstate", "running", 3.0, "start RAPID")


def stop_rapid(rws: Rws, timeout: float = 1.0) -> None:
    """Stop RAPID in all tasks with a quick stop."""
    rws.act("/rw/rapid/execution", "stop", {"stopmode": "qstop", "usetsp": "alltsk"}, timeout)
