"""Requests about alarms (docs/protocol/alarms.md)."""

from dataclasses import dataclass

from arcor2_hw.data.rpc import (
    AcknowledgeAlarmArgs,
    AlarmStatisticsArgs,
    AlarmStatisticsData,
    ListAlarmsArgs,
    ListAlarmsData,
    ShelveAlarmArgs,
)
from arcor2_server.alarms.service import Alarms
from arcor2_server.rpc.registry import Context, rpc


@dataclass(frozen=True, slots=True)
class AlarmRequests:
    """Requests about alarms (docs/protocol/alarms.md)."""

    _alarms: Alarms

    @rpc("ListAlarms")
    async def list_alarms(self, context: Context, args: ListAlarmsArgs) -> ListAlarmsData:
        """Return records of alarms."""
        return ListAlarmsData(await self._alarms.find(args))

    @rpc("AcknowledgeAlarm")
    async def acknowledge_alarm(self, context: Context, args: AcknowledgeAlarmArgs) -> None:
        """Acknowledge an alarm."""
        await self._alarms.acknowledge(args.number, context.user, context.client.role, args.note)

    @rpc("ShelveAlarm")
    async def shelve_alarm(self, context: Context, args: ShelveAlarmArgs) -> None:
        """Shelve an alarm, or end its shelving."""
        await self._alarms.shelve(args.number, args.seconds, context.user, args.note)

    @rpc("AlarmStatistics")
    async def alarm_statistics(self, context: Context, args: AlarmStatisticsArgs) -> AlarmStatisticsData:
        """Return the worst alarms of the past days."""
        return self._alarms.statistics(args)
