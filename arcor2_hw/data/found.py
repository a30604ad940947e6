"""What the integrator's tools find: things that are connected to a machine, and how the devices of a cell are."""

from msgspec import field

from arcor2_hw.data.base import Data
from arcor2_hw.data.device import Alarm, Connection, Health, Identity


class Found(Data, frozen=True):
    """One thing that is connected: its kind, where it is (as a setting would say), what it says of itself."""

    kind: str
    address: str
    description: str = ""
    serial: str = ""


class Checked(Data, frozen=True):
    """How one device of a cell is. `seconds` to connect. problem: what went wrong, empty when nothing did."""

    name: str
    type: str
    address: str = ""
    connection: Connection = Connection.FAILED
    identity: Identity | None = None
    health: Health = Health.NORMAL
    alarms: list[Alarm] = field(default_factory=list)
    control_owner: str | None = None
    seconds: float = 0.0
    problem: str = ""

    @property
    def fit(self) -> bool:
        """Tell whether it is there and fit for work."""
        return not self.problem and self.health not in (Health.FAILURE, Health.OFF_SPEC)
