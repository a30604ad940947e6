"""The alarms of the cell as conditions (OPC 10000-9): an event for each change, refresh, acknowledgement."""

import uuid
from collections import deque
from collections.abc import Awaitable, Callable
from datetime import datetime
from typing import Any, Final

from asyncua import Server, ua
from asyncua.common.event_objects import AlarmCondition

from arcor2_hw.data.alarms import AlarmRecord, Priority
from arcor2_hw.opcua.messages import CallAnswer
from arcor2_hw.opcua.space import Space, node_id, status_code

SEVERITIES: Final = {Priority.LOW: 200, Priority.MEDIUM: 400, Priority.HIGH: 600, Priority.URGENT: 800}
"""Severity by priority (OPC 10000-9: 1 to 1000)."""
KNOWN_EVENTS: Final = 16
"""Number of stored event identifiers of an alarm."""
_SERVER: Final = node_id(ua.ObjectIds.Server)
_TEXTS: Final = {
    "EnabledState": ("Enabled", "Disabled"),
    "ActiveState": ("Active", "Inactive"),
    "AckedState": ("Acknowledged", "Unacknowledged"),
}
Acknowledge = Callable[[int, str], Awaitable[CallAnswer]]
"""Acknowledges an alarm: its number, and a comment."""


class Conditions:
    """The alarms. Each retained alarm is a condition; its last event is repeated by ConditionRefresh.

    Args:
        space: the address space.
        source: returns the node and the name of the source of an alarm.
        acknowledge: acknowledges an alarm.
    """

    def __init__(
        self, space: Space, source: Callable[[AlarmRecord], tuple[ua.NodeId, str]], acknowledge: Acknowledge
    ) -> None:
        self._space, self._source, self._acknowledge = space, source, acknowledge
        self.retained: dict[int, AlarmRecord] = {}
        """The alarms that need attention, by number."""
        self._newest = 0
        self._events: dict[int, deque[bytes]] = {}
        """The identifiers of the last events of each retained alarm, any of which a client may acknowledge."""

    @staticmethod
    async def prepare(server: Server) -> None:
        """Let clients subscribe to the events of the server object."""
        await server.get_node(_SERVER).set_event_notifier([ua.EventNotifier.SubscribeToEvents])

    async def change(self, alarm: AlarmRecord) -> None:
        """Publish the event of a changed alarm."""
        is_new = alarm.number > self._newest
        self._newest = max(self._newest, alarm.number)
        if alarm.retain:
            self.retained[alarm.number] = alarm
        elif self.retained.pop(alarm.number, None) is None and not is_new:
            return  # a later change of an alarm that needs no attention, such as a note
        event = self._event(alarm)
        if alarm.retain:
            self._events.setdefault(alarm.number, deque(maxlen=KNOWN_EVENTS)).append(event.EventId)
        else:
            self._events.pop(alarm.number, None)
        await self._space.server.iserver.subscription_service.trigger_event(event)

    def _event(self, alarm: AlarmRecord) -> Any:
        event: Any = AlarmCondition()  # type: ignore[no-untyped-call]
        node, name = self._source(alarm)
        changed = alarm.acknowledged_at or alarm.cleared or alarm.raised
        values = {
            "EventId": uuid.uuid4().bytes,
            "SourceNode": node,
            "SourceName": name,
            "Time": datetime.fromisoformat(changed),
            "ReceiveTime": datetime.fromisoformat(changed),
            "Message": ua.LocalizedText(" ".join(filter(None, (alarm.text, alarm.remedy)))),
            "Severity": SEVERITIES[alarm.priority],
            "ConditionClassId": node_id(ua.ObjectIds.ProcessConditionClassType),
            "ConditionClassName": ua.LocalizedText("ProcessConditionClass"),
            "ConditionName": alarm.kind,
            "BranchId": ua.NodeId(),
            "Retain": alarm.retain,
            "Quality": status_code(0),
            "LastSeverity": SEVERITIES[alarm.priority],
            "Comment": ua.LocalizedText(alarm.note or ""),
            "ClientUserId": alarm.acknowledged_by or "",
            "InputNode": ua.NodeId(),
            "SuppressedOrShelved": bool(alarm.shelved_until),
        }
        for state, is_set in (("Enabled", True), ("Active", alarm.active), ("Acked", alarm.acknowledged)):
            texts = _TEXTS[f"{state}State"]
            values[f"{state}State"] = ua.LocalizedText(texts[0] if is_set else texts[1])
            values[f"{state}State/Id"] = is_set
        event.add_property("NodeId", None, ua.VariantType.NodeId)
        values["NodeId"] = self._space.own("alarms", str(alarm.number))
        for name, value in values.items():
            setattr(event, name, value)
        event.emitting_node = _SERVER
        return event

    async def acknowledge(self, condition: ua.NodeId, arguments: list[ua.Variant]) -> ua.StatusCode:
        """Acknowledge a condition; return the status of the call."""
        kind, _, number = str(condition.Identifier).partition("/")
        if condition.NamespaceIndex != self._space.own("").NamespaceIndex or kind != "alarms" or not number.isdigit():
            return status_code(ua.StatusCodes.BadNodeIdUnknown)
        alarm = self.retained.get(int(number))
        if alarm is None:
            return status_code(ua.StatusCodes.BadNodeIdUnknown)
        if len(arguments) != 2:
            return status_code(ua.StatusCodes.BadArgumentsMissing)
        event_id, comment = (argument.Value for argument in arguments)
        if event_id not in self._events.get(alarm.number, ()):
            return status_code(ua.StatusCodes.BadEventIdUnknown)
        if alarm.acknowledged:
            return status_code(ua.StatusCodes.BadConditionBranchAlreadyAcked)
        text = comment.Text if isinstance(comment, ua.LocalizedText) and comment.Text else ""
        answer = await self._acknowledge(alarm.number, text)
        return status_code(ua.StatusCodes.BadUserAccessDenied if answer.result else 0)
