"""The parts of the server, each made once, known to each other through this one object."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from arcor2_server.aiming import Aiming
from arcor2_server.calibration import Calibration, NoCalibration, RunningCalibrations
from arcor2_server.collisions import CollisionWorld
from arcor2_server.kept import KeptAnswers
from arcor2_server.type_news import TypeNews

if TYPE_CHECKING:
    from arcor2_hw.data.events import Event
    from arcor2_server.access import Access
    from arcor2_server.build.service import BuildService
    from arcor2_server.cell.online import OnlineCell
    from arcor2_server.execution import Execution
    from arcor2_server.hub import Hub
    from arcor2_server.locks import Locks
    from arcor2_server.object_types import ObjectTypes
    from arcor2_server.session import Session
    from arcor2_server.settings import ServerSettings
    from arcor2_server.storage import AssetStore, Storage
    from arcor2_server.users import Users


@dataclass(slots=True)
class Services:
    """What handlers work with.

    access: who gets in. hub: the connected clients. users: who is logged in. locks: who holds what.
    storage: saved documents. assets: meshes and the like. types: what is known of object types.
    session: the open scene or project.
    cell: the scene when online. execution: packages and the running program. build: project to package.
    calibration: poses from pictures. calibrations: what is being calibrated. aiming: who points a robot at an object.
    collisions: what is in the way. type_news: object types that clients have to be told of. kept: encoded answers.
    """

    settings: "ServerSettings"
    access: "Access"
    hub: "Hub"
    users: "Users"
    locks: "Locks"
    storage: "Storage"
    assets: "AssetStore"
    types: "ObjectTypes"
    session: "Session"
    cell: "OnlineCell"
    execution: "Execution"
    build: "BuildService"
    calibration: Calibration = field(default_factory=NoCalibration)
    calibrations: RunningCalibrations = field(default_factory=RunningCalibrations)
    aiming: Aiming = field(default_factory=Aiming)
    collisions: CollisionWorld = field(default_factory=CollisionWorld)
    type_news: TypeNews = field(default_factory=TypeNews)
    kept: KeptAnswers = field(default_factory=KeptAnswers)

    def greeting(self) -> list["Event"]:
        """Give what a client is sent when it is let in: what is open, what runs, or the main screen."""
        return self.session.greeting() or self.execution.greeting() or [self.hub.main_screen]
