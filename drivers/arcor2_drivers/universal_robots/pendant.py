"""The teach pendant as seen through the dashboard server: remote control, operating mode, programs, commands."""

import logging
import time
from typing import Final

from arcor2_hw.data.device import Identity
from arcor2_hw.data.robot import Control, Mode
from arcor2_hw.exceptions import DeviceError, NotConnected, NotInControl, Refused

from . import dashboard
from .dashboard import Dashboard

MAX_AGE: Final = 0.5
"""Time for which an answer is reused, s; an operator does not turn the key faster."""
TIMEOUT: Final = 0.3
"""Time for the answers that are requested periodically, s."""
POLYSCOPE_X: Final = 10
"""First major version that may have no dashboard server."""

log = logging.getLogger(__name__)


class Pendant:
    """Settings of the operator at the teach pendant, and commands that replace its buttons."""

    def __init__(self, name: str, host: str) -> None:
        self.name = name
        self.dashboard = Dashboard(host)
        self.available = True
        """Whether the controller has a dashboard server."""
        self._asked = -1e9
        self._control, self._mode = Control.LOCAL, Mode.OTHER

    def open(self, timeout: float, major_version: int) -> None:
        """Connect to the dashboard server. Raise DeviceError if it is missing on a controller that must have one."""
        self.available = True
        try:
            self.dashboard.open(timeout)
        except NotConnected:
            if major_version < POLYSCOPE_X:
                raise
            self.available = False  # the default of PolyScope X

    def state(self, max_age: float = MAX_AGE) -> tuple[Control, Mode]:
        """Return who controls the robot, and its operating mode. Without an answer, return the last known values."""
        if not self.available:
            return Control.REMOTE, Mode.OTHER
        if time.monotonic() - self._asked > max_age:
            try:
                remote = dashboard.is_remote(self.dashboard.ask("is in remote control", TIMEOUT))
                self._control = Control.REMOTE if remote else Control.LOCAL
                answer = self.dashboard.ask("get operational mode", TIMEOUT)
                self._mode = dashboard.operational_mode(answer, remote)
            except DeviceError as e:
                log.warning("%s: the dashboard server does not report who has control: %s", self.name, e)
                if self._asked < 0.0:
                    raise
            self._asked = time.monotonic()
        return self._control, self._mode

    @property
    def manual(self) -> bool:
        """Return whether the robot is in a manual mode, which limits its speed."""
        return self.state()[1] in (Mode.MANUAL_REDUCED_SPEED, Mode.MANUAL_HIGH_SPEED)

    def program(self) -> str:
        """Return the name of the loaded program; "a program" if it is unknown."""
        try:
            name = dashboard.program_name(self.dashboard.ask("programState")) if self.available else ""
        except DeviceError:
            name = ""
        return name or "a program"

    def identify(self, model: str, firmware: str) -> Identity:
        """Return the identity of the robot; without a dashboard server, only `model` and `firmware`."""
        if not self.available:
            return Identity("Universal Robots", model, "", firmware)
        serial = self.dashboard.ask("get serial number").strip()
        model = self.dashboard.ask("get robot model").strip()
        software = dashboard.version(self.dashboard.ask("PolyscopeVersion"))
        return Identity("Universal Robots", model, serial, software or firmware)

    def do(self, command: str, expected: str) -> None:
        """Send a command. Raise Refused without a dashboard server, NotInControl in local control."""
        if not self.available:
            raise Refused(
                "{name} has no dashboard server. Use the pendant for {command!r}.", name=self.name, command=command
            )
        if self.state(max_age=0.0)[0] is Control.LOCAL:
            raise NotInControl(
                "{name} is in local control. Use the pendant for {command!r}.", name=self.name, command=command
            )
        self.dashboard.do(command, expected)
