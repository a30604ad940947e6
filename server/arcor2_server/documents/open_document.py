"""What is open, to be read: the scene and project, what differs from what is saved, look-ups by id."""

from typing import TYPE_CHECKING

from msgspec.structs import replace

from arcor2_hw.data.events import Event, OpenProjectData, OpenSceneData, SceneStateData
from arcor2_hw.data.project import (
    Action,
    BareActionPoint,
    BareProject,
    NamedOrientation,
    Project,
    ProjectParameter,
    ProjectRobotJoints,
)
from arcor2_hw.data.scene import BareScene, Scene, SceneObject
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.document import Document
from arcor2_server.documents.journal_records import Times
from arcor2_server.documents.unsaved import Unsaved
from arcor2_server.errors import RequestRefused
from arcor2_server.events import make_event

if TYPE_CHECKING:
    from arcor2_server.services import Services


class OpenDocument:
    """The open scene, or project on its scene."""

    def __init__(self, services: "Services") -> None:
        self.document = Document()
        self._services = services
        self._scene_times = Times()
        self._project_times = Times()
        self._unsaved = Unsaved()
        self._scene: Scene | None = None
        self._project: Project | None = None

    @property
    def scene(self) -> Scene | None:
        """The open scene as it is now, None when there is none."""
        if self._scene is None and (scene := self.document.scene) is not None:
            self._scene = replace(scene, **self._scene_times.fields())
        return self._scene

    @property
    def project(self) -> Project | None:
        """The open project as it is now, None when there is none."""
        if self._project is None and (project := self.document.project) is not None:
            self._project = replace(project, **self._project_times.fields())
        return self._project

    def require_scene(self) -> Scene:
        """Give the open scene; RequestRefused when there is none."""
        if (scene := self.scene) is None:
            raise RequestRefused("No scene is open: open one first.")
        return scene

    def require_project(self) -> Project:
        """Give the open project; RequestRefused when there is none."""
        self.require_project_open()
        assert self.project is not None
        return self.project

    def require_scene_open(self) -> Document:
        """Give the document when a scene is open, with or without a project; else RequestRefused."""
        if not self.document.count(Kind.SCENE):
            raise RequestRefused("No scene is open: open one first.")
        return self.document

    def require_scene_alone(self) -> Document:
        """Give the document when a scene is open and no project; else RequestRefused."""
        document = self.require_scene_open()
        if document.count(Kind.PROJECT):
            raise RequestRefused("The scene cannot be changed while a project is open: close the project first.")
        return document

    def require_project_open(self) -> Document:
        """Give the document when a project is open; else RequestRefused."""
        self.require_scene_open()
        if not self.document.count(Kind.PROJECT):
            raise RequestRefused("No project is open: open one first.")
        return self.document

    def require_nothing_open(self) -> None:
        """RequestRefused when a scene or project is open."""
        if self.document.count(Kind.PROJECT):
            raise RequestRefused(f"The project {self._name(Kind.PROJECT)} is open: close it first.")
        if self.document.count(Kind.SCENE):
            raise RequestRefused(f"The scene {self._name(Kind.SCENE)} is open: close it first.")

    def bare_scene(self) -> BareScene:
        """Give the open scene without its objects."""
        value = self.document.of_kind(Kind.SCENE)[0].value
        return BareScene(name=value.name, description=value.description, id=value.id, **self._scene_times.fields())

    def bare_project(self) -> BareProject:
        """Give the open project without its content."""
        value = self.document.of_kind(Kind.PROJECT)[0].value
        return BareProject(
            name=value.name,
            scene_id=value.scene_id,
            description=value.description,
            has_logic=value.has_logic,
            id=value.id,
            **self._project_times.fields(),
        )

    @property
    def scene_changed(self) -> bool:
        """Whether the open scene has changes that are not saved."""
        return bool(self.document.count(Kind.SCENE)) and self._scene_times.unsaved

    @property
    def project_changed(self) -> bool:
        """Whether the open project has changes that are not saved."""
        return bool(self.document.count(Kind.PROJECT)) and self._project_times.unsaved

    @property
    def has_changes(self) -> bool:
        """Whether closing would lose something."""
        return self.scene_changed or self.project_changed

    def greeting(self) -> list[Event]:
        """Give the events that tell a new connection what is open; none when nothing is."""
        if (scene := self.scene) is None:
            return []
        state = make_event("SceneState", SceneStateData(self._services.cell.state))
        if (project := self.project) is not None:
            return [make_event("OpenProject", OpenProjectData(scene, project)), state]
        return [make_event("OpenScene", OpenSceneData(scene)), state]

    def _name(self, kind: Kind) -> str | None:
        return next((item.value.name for item in self.document.of_kind(kind)), None)

    def _forget_snapshots(self) -> None:
        self._scene = None
        self._project = None

    # ------------------------------------------------------------------------------------------ look-ups
    def scene_object(self, object_id: str) -> SceneObject:
        """Give an object of the scene; NotFound."""
        return self.document.scene_object(object_id)

    def action_point(self, action_point_id: str) -> BareActionPoint:
        """Give an action point without its lists; NotFound."""
        return self.document.action_point(action_point_id)

    def orientation(self, orientation_id: str) -> tuple[BareActionPoint, NamedOrientation]:
        """Give an orientation with its action point; NotFound."""
        return self.document.orientation(orientation_id)

    def joints(self, joints_id: str) -> tuple[BareActionPoint, ProjectRobotJoints]:
        """Give joints with their action point; NotFound."""
        return self.document.joints(joints_id)

    def action(self, action_id: str) -> tuple[BareActionPoint, Action]:
        """Give an action with its action point; NotFound."""
        return self.document.action(action_id)

    def parameter(self, parameter_id: str) -> ProjectParameter:
        """Give a project parameter; NotFound."""
        return self.document.parameter(parameter_id)

    def root_of(self, item: str) -> str:
        """Give the root of the lock tree that an id belongs to; NotFound."""
        return self.document.root_of(item)

    def tree_of(self, root: str) -> list[str]:
        """Give the ids below a root of a lock tree."""
        return self.document.tree_of(root)
