"""ControlSession: what is ours while we control: mastership of RAPID, and a line to each arm's motion server."""

import math
import threading
import time
from collections.abc import Callable
from typing import Final

from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import DeviceError, DeviceTimeout, NotInControl, Refused

from .arm_line import ArmLine
from .frames import orientation_values, position_values
from .motion_lines import Code
from .rws import Rws
from .settings import ARMS, YumiSettings

LINE_WITHIN: Final = 2.0
"""Seconds the servers may take to listen after the program was started."""
POLL: Final = 0.05

Load = tuple[float, tuple[float, float, float]]


class ControlSession:
    """Control of both arms. `ended` is why it is over, None while it lives, `ended_at` when (monotonic); `over` is told
    when it ends itself.
    """

    def __init__(self, name: str, settings: YumiSettings, over: Callable[[DeviceError], None]) -> None:
        self.ended: DeviceError | None = None
        self.ended_at = math.inf
        self.lines = {arm: ArmLine(name, arm, settings.host, settings.port(arm), self._line_ended) for arm in ARMS}
        self._settings = settings
        self._over = over
        self._ending = threading.Lock()

    def open(self) -> None:
        """Connect to both servers and begin their sessions. Raises DeviceError naming the address."""
        for line in self.lines.values():
            line.open(LINE_WITHIN, self._settings.watchdog)

    def tell_tool(self, arm: str, tcp: Pose, load: Load) -> None:
        """Tell an arm's server of its tool."""
        line = self.lines[arm]
        line.ask(Code.TOOL, *position_values(tcp), *orientation_values(tcp))
        line.ask(Code.LOAD, load[0], *(value * 1e3 for value in load[1]))

    def end(self, why: DeviceError, wait: bool = True) -> None:
        """End it: the servers stop their arms. Harmless when it is over."""
        with self._ending:
            if self.ended is None:
                self.ended, self.ended_at = why, time.monotonic()
        for line in self.lines.values():
            line.end(why, wait)

    def _line_ended(self, why: DeviceError) -> None:
        first = self.ended is None
        self.end(why, wait=False)
        if first:
            self._over(why)


def request_mastership(rws: Rws, domain: str) -> None:
    """Have mastership of a domain. Raises Refused with the controller's words."""
    rws.act(f"/rw/mastership/{domain}", "request")


def release_mastership(rws: Rws, domain: str) -> bool:
    """Give mastership of a domain back; not having it is no error. Tells whether the controller has confirmed it."""
    try:
        rws.act(f"/rw/mastership/{domain}", "release")
    except Refused:
        return True
    except DeviceError:
        return False
    return True


def await_value(rws: Rws, path: str, field: str, value: str, within: float, what: str) -> None:
    """Wait until a resource says something. Raises DeviceTimeout naming what was waited for."""
    until = time.monotonic() + within
    while rws.value(path, field) != value:
        if time.monotonic() > until:
            raise DeviceTimeout(f"{rws.who} did not {what} within {within:g} s")
        time.sleep(POLL)


def start_rapid(rws: Rws) -> None:
    """Start RAPID from main in all tasks: whatever motion was left half done is forgotten. Needs mastership."""
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
    """Stop RAPID in all tasks quickly."""
    rws.act("/rw/rapid/execution", "stop", {"stopmode": "qstop", "usetsp": "alltsk"}, timeout)


def not_controlled(name: str, why: DeviceError | None) -> NotInControl:
    """Give the error of a command without control."""
    return NotInControl(f"control of {name} is not taken" + (f": {why}" if why is not None else ""))
