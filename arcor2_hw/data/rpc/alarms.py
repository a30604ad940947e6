"""Requests about alarms (docs/protocol/alarms.md)."""

from typing import Annotated, Final

from msgspec import Meta

from arcor2_hw.data.alarms import AlarmFilter, AlarmFrequency, AlarmRecord
from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc

MAX_SHELVING_TIME: Final = 28_800.0
"""Longest time for which an alarm can be shelved, s: one shift."""
Note = Annotated[str, Meta(max_length=500)]


class ListAlarmsArgs(Data, frozen=True):
    """Arguments of ListAlarms: selection of records, maximum number, upper limit of the record number, object, run."""

    show: AlarmFilter = AlarmFilter.RETAINED
    limit: Annotated[int, Meta(ge=1, le=1000)] = 100
    before: int | Unset = UNSET
    object_id: str | Unset = UNSET
    run: int | Unset = UNSET


class ListAlarmsData(Data, frozen=True):
    """Answer to ListAlarms: records, newest first."""

    alarms: list[AlarmRecord]


class AcknowledgeAlarmArgs(Data, frozen=True):
    """Arguments of AcknowledgeAlarm: number of the record, and a note."""

    number: int
    note: Note = ""


class ShelveAlarmArgs(Data, frozen=True):
    """Arguments of ShelveAlarm: number of the record, time in s (0 ends the shelving), and a note."""

    number: int
    seconds: Annotated[float, Meta(ge=0.0, le=MAX_SHELVING_TIME)]
    note: Note = ""


class AlarmStatisticsArgs(Data, frozen=True):
    """Arguments of AlarmStatistics: number of past days, and maximum number of alarms in each list."""

    days: Annotated[float, Meta(gt=0.0, le=366.0)] = 7.0
    limit: Annotated[int, Meta(ge=1, le=100)] = 10


class AlarmStatisticsData(Data, frozen=True):
    """Answer to AlarmStatistics: start of the period, the most frequent alarms, and those that were active longest."""

    since: Timestamp
    by_count: list[AlarmFrequency]
    by_duration: list[AlarmFrequency]


ALARM_RPCS: Final = (
    Rpc("AcknowledgeAlarm", AcknowledgeAlarmArgs, None, Role.OPERATOR, additional=True),
    Rpc(
        "AlarmStatistics", AlarmStatisticsArgs, AlarmStatisticsData, Role.OPERATOR, args_optional=True, additional=True
    ),
    Rpc("ListAlarms", ListAlarmsArgs, ListAlarmsData, Role.OPERATOR, args_optional=True, additional=True),
    Rpc("ShelveAlarm", ShelveAlarmArgs, None, Role.TECHNICIAN, additional=True),
)
"""Requests about alarms."""


# Names before version 0.2.
LONGEST_SHELVING = MAX_SHELVING_TIME
