"""Starts the process of the MQTT clients, and watches their connections to the broker."""

import asyncio
from importlib.metadata import version
from typing import Final

import structlog

from arcor2_hw.messages import Message
from arcor2_hw.mqtt import messages as m
from arcor2_server.alarms.service import Alarms
from arcor2_server.plant.feed import CellFeed
from arcor2_server.plant.process import PlantProcess
from arcor2_server.settings import ServerSettings

log = structlog.get_logger(__name__)

NAME: Final = "MQTT process"
ALARM_AFTER: Final = 60.0
"""Time without a connection to the broker after which an alarm is raised, s."""


class Mqtt:
    """Publishes the cell over MQTT.

    Args:
        settings: settings of the server, with a broker.
        feed: source of the published data.
        alarms: the alarms.
    """

    def __init__(self, settings: ServerSettings, feed: CellFeed, alarms: Alarms) -> None:
        self._settings, self._feed, self._alarms = settings, feed, alarms
        self.process: PlantProcess | None = None
        self._lost: dict[str, asyncio.TimerHandle] = {}
        """Timers for the alarms of links without a connection."""
        self.connected: dict[str, bool] = {}
        """Whether each link is connected to the broker."""
        self.dropped = 0
        """Number of values that were dropped."""

    def start(self) -> None:
        """Start the process in the background."""
        reader = self._feed.reader()
        self.process = PlantProcess(
            NAME, "arcor2_hw.mqtt", reader, self._alarms, "mqtt_ended", self._setup, self._received
        )
        self.process.start()

    async def close(self) -> None:
        """End the process. It publishes death certificates."""
        for timer in self._lost.values():
            timer.cancel()
        if self.process is not None:
            await self.process.close()

    def _setup(self) -> m.Setup:
        mqtt = self._settings.mqtt
        assert mqtt is not None
        broker = m.Broker(
            mqtt.host, mqtt.port, mqtt.tls, mqtt.user, mqtt.password, mqtt.authority, mqtt.certificate, mqtt.key
        )
        sparkplug = m.Sparkplug(mqtt.group, mqtt.node, mqtt.primary_host) if mqtt.group else None
        folder = str(self._settings.data_dir.absolute())
        return m.Setup(broker, sparkplug, mqtt.prefix, folder, version("arcor2-hw"))

    async def _received(self, body: bytes) -> None:
        match m.decode_from_process(body):
            case m.LinkChanged(link, connected, reason):
                self._link_changed(link, reason, connected=connected)
            case m.ValuesDropped(count):
                self.dropped += count
                log.warning("values dropped: too many waited for the MQTT broker or the host", count=count)

    def _link_changed(self, link: str, reason: str, *, connected: bool) -> None:
        mqtt = self._settings.mqtt
        assert mqtt is not None
        broker = f"{mqtt.host}:{mqtt.port}"
        self.connected[link] = connected
        if (timer := self._lost.pop(link, None)) is not None:
            timer.cancel()
        if connected:
            log.info("connected to the MQTT broker", link=link, broker=broker)
            if not self._lost:
                self._alarms.system("mqtt_broker_lost", False)
        else:
            log.warning("not connected to the MQTT broker", link=link, broker=broker, reason=reason)
            loop = asyncio.get_running_loop()
            self._lost[link] = loop.call_later(ALARM_AFTER, self._raise_alarm, broker, reason)

    def _raise_alarm(self, broker: str, reason: str) -> None:
        text = Message.of("The MQTT broker {broker} is not connected: {reason}", broker=broker, reason=reason)
        self._alarms.system("mqtt_broker_lost", True, text)
