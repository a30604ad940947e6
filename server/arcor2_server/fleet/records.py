"""The records that cells publish, and their subjects (docs/protocol/fleet.md)."""

from typing import Annotated, Any, Final

import msgspec
from msgspec import Meta, field

from arcor2_hw.data.alarms import AlarmRecord, Priority
from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.cell_state import CellAuthority, CellMode, CellStateName
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.units import UnitRecord
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message
from arcor2_server.settings import CELL_NAME

PREFIX: Final = "arcor2hw.fleet"
"""First tokens of all subjects."""
STATES: Final = f"{PREFIX}.*.state"
"""Subject of the states of all cells."""
BEAT_PERIOD: Final = 0.5
"""Longest time between two states of a cell, s."""
MAX_STATE: Final = 16 * 1024
"""Maximum size of a state, bytes."""
MAX_RESULT: Final = 1024 * 1024
"""Maximum size of a result, bytes: the largest message that a broker accepts by default."""
MAX_NAMES: Final = 8
"""Maximum number of users, and of devices, that a state names."""

Name = Annotated[str, Meta(max_length=200)]
Text = Annotated[str, Meta(max_length=1000)]
Id = Annotated[str, Meta(min_length=1, max_length=64)]
Count = Annotated[int, Meta(ge=0)]
Address = Annotated[str, Meta(max_length=300, pattern=r"^(https?://[^\s]+)?$")]
"""An address of a page. Other schemes, such as javascript, are refused, since the page of the fleet links to it."""
Domain = Annotated[str, Meta(max_length=63, pattern=r"^[A-Za-z0-9_-]*$")]


Translations = dict[str, dict[str, str]]
"""Translations of texts by language and English text or template. Drivers of a cell have some of their own."""


class FirstAlarm(Data, frozen=True):
    """The alarm of a cell that needs a person first.

    device: its name; empty for the program and the system. translations: of its text, as far as a driver has them.
    """

    priority: Priority
    text: Text
    raised: Timestamp
    device: Name = ""
    text_message: Message | Unset = UNSET
    translations: Translations = field(default_factory=dict)


class FleetState(Data, frozen=True, kw_only=True):
    """The state of a cell.

    identity: id of the data of the server. boot: id of the process of the server. number: counts the states of this
    process. address: of its editor; empty if only its own computer reaches it. domain: JetStream domain in which its
    results are stored. program: name of the running or last program. held: whether the program waits for a person after
    a failed action. good, bad, rejected: units that left the cell in the last 8 hours. urgent, high, medium, low:
    alarms that need attention. started_by: who started the running program. users: who is connected. controlling: who
    of them has locked something, such as a robot. missing: names of devices that are not connected. waiting: results
    that the broker has not stored yet.
    """

    identity: Id
    boot: Id
    number: Count
    version: Name
    state: CellStateName
    mode: CellMode
    authority: CellAuthority
    program_state: PackageStateEnum
    address: Address = ""
    domain: Domain = ""
    program: Name = ""
    recipe: Name = ""
    held: bool = False
    good: Count = 0
    bad: Count = 0
    rejected: Count = 0
    urgent: Count = 0
    high: Count = 0
    medium: Count = 0
    low: Count = 0
    first_alarm: FirstAlarm | Unset = UNSET
    started_by: Name = ""
    users: Annotated[tuple[Name, ...], Meta(max_length=MAX_NAMES)] = ()
    controlling: Annotated[tuple[Name, ...], Meta(max_length=MAX_NAMES)] = ()
    missing: Annotated[tuple[Name, ...], Meta(max_length=MAX_NAMES)] = ()
    waiting: Count = 0


class UnitResult(Data, frozen=True, tag="unit", tag_field="kind"):
    """The record of a unit that has left the cell. See AlarmResult; the translations are of errors of steps."""

    identity: Id
    record: UnitRecord
    translations: Translations = field(default_factory=dict)


class AlarmResult(Data, frozen=True, tag="alarm", tag_field="kind"):
    """The record of an alarm. identity: of the cell. translations: of its texts, as far as a driver has them."""

    identity: Id
    record: AlarmRecord
    translations: Translations = field(default_factory=dict)


Result = UnitResult | AlarmResult

encode: Final = msgspec.json.Encoder().encode
_decode_state: Any = msgspec.json.Decoder(FleetState).decode
_decode_result: Any = msgspec.json.Decoder(Result).decode


def state_subject(cell: str) -> str:
    """Return the subject of the state of a cell."""
    return f"{PREFIX}.{cell}.state"


def result_subjects(cell: str) -> list[str]:
    """Return the subjects of the results of a cell."""
    return [f"{PREFIX}.{cell}.{kind}" for kind in ("unit", "alarm")]


def answer_subject(cell: str) -> str:
    """Return the start of the subjects on which a paired cell receives answers of the broker."""
    return f"{PREFIX}.{cell}.answer"


def stream_name(cell: str) -> str:
    """Return the name of the stream with the results of a cell."""
    return f"ARCOR2_HW_FLEET_{cell}"


def cell_of(subject: str) -> str:
    """Return the cell in a subject. Raise InvalidData if it has no valid name."""
    name = subject.removeprefix(f"{PREFIX}.").partition(".")[0]
    if not CELL_NAME.fullmatch(name):
        raise InvalidData("{name!r} is not a name of a cell.", name=name[:80])
    return name


def decode_state(data: bytes) -> FleetState:
    """Return a state that was received. Raise InvalidData if it is too large or not a state."""
    state: FleetState = _decoded(data, MAX_STATE, _decode_state)
    return state


def decode_result(data: bytes) -> Result:
    """Return a result that was received. Raise InvalidData if it is too large or not a result."""
    result: Result = _decoded(data, MAX_RESULT, _decode_result)
    return result


def _decoded(data: bytes, limit: int, decode: Any) -> Any:
    if len(data) > limit:
        raise InvalidData("The message has {size} bytes; at most {limit} are accepted.", size=len(data), limit=limit)
    try:
        return decode(data)
    except msgspec.MsgspecError as error:
        raise InvalidData("{reason}", reason=error) from None
    except RecursionError:
        raise InvalidData("The message is nested too deeply.") from None
