"""The message with which a cell host runs a package."""

import asyncio
from pathlib import Path

from msgspec.structs import replace

from arcor2_hw.runtime import messages as m
from arcor2_server.execution.breakpoints import SharedBreakpoints
from arcor2_server.execution.runs import How
from arcor2_server.settings import ServerSettings
from arcor2_server.storage.setting_secrets import SettingSecrets
from arcor2_server.workspace.host_world import HostWorld


class RunMessages:
    """Prepares the messages."""

    def __init__(
        self,
        settings: ServerSettings,
        secrets: SettingSecrets,
        breakpoints: SharedBreakpoints,
        host_world: HostWorld,
    ) -> None:
        self._settings = settings
        self._secrets = secrets
        self._breakpoints = breakpoints
        self._host_world = host_world

    def prepare(self, package_id: str, directory: Path, how: How) -> m.RunPackage:
        """Return the message without what changes until the host is ready.

        Args:
            package_id: the package.
            directory: where its files are.
            how: how it runs.
        """
        return m.RunPackage(
            package_id,
            str(directory.resolve()),
            how.start_paused,
            sorted(how.breakpoints),
            self._settings.streaming_period,
            self._settings.cell,
            assets=self._host_world.shape_files(),
        )

    async def complete(self, message: m.RunPackage, shared_of: str) -> m.RunPackage:
        """Add secrets, shared breakpoints, collision models and robot calibrations. Send the message at once.

        Args:
            message: what `prepare` returned.
            shared_of: the project whose shared breakpoints the program pauses at; empty for none.

        Raises:
            NotFound: a secret is missing.
            StorageError: the breakpoints cannot be read.
        """
        directory = Path(message.directory)
        message = replace(message, secrets=await asyncio.to_thread(self._secrets.values_for_package, directory))
        if shared_of:  # at the last moment: a later change is sent to the program
            shared = await self._breakpoints.ids(shared_of)
            message = replace(message, shared_breakpoints=sorted(shared))
        calibrations = await self._host_world.calibrations_of_package(directory)
        return self._host_world.with_world(message, calibrations)
