"""Read access to the open scene and project: content, unsaved changes, look-ups by id."""

from msgspec.structs import replace

from arcor2_hw.data.events import Event, OpenProjectData, OpenSceneData, SceneStateData, SceneStateEnum
from arcor2_hw.data.project import BareProject, Project
from arcor2_hw.data.scene import BareScene, Scene
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.document import Document, reduce_to
from arcor2_server.documents.journal_records import Times
from arcor2_server.documents.unsaved import Unsaved
from arcor2_server.errors import RequestRefused
from arcor2_server.events import make_event


class OpenDocument:
    """Read access to the open scene, or the open project on its scene."""

    def __init__(self) -> None:
        self.document = Document()
        self._scene_times = Times()
        self._project_times = Times()
        self._unsaved = Unsaved()
        self._scene: Scene | None = None
        self._project: Project | None = None

    @property
    def scene(self) -> Scene | None:
        """The open scene with unsaved changes, None if none is open."""
        if self._scene is None and (scene := self.document.scene) is not None:
            self._scene = replace(scene, **self._scene_times.fields())
        return self._scene

    @property
    def project(self) -> Project | None:
        """The open project with unsaved changes, None if none is open."""
        if self._project is None and (project := self.document.project) is not None:
            self._project = replace(project, **self._project_times.fields())
        return self._project

    def require_scene(self) -> Scene:
        """Return the open scene. Raise RequestRefused if none is open."""
        if (scene := self.scene) is None:
            raise RequestRefused("No scene is open: open one first.")
        return scene

    def require_project(self) -> Project:
        """Return the open project. Raise RequestRefused if none is open."""
        self.require_project_open()
        assert self.project is not None
        return self.project

    def require_scene_open(self) -> Document:
        """Return the document if a scene is open, with or without a project. Otherwise raise RequestRefused."""
        if not self.document.count(Kind.SCENE):
            raise RequestRefused("No scene is open: open one first.")
        return self.document

    def require_scene_alone(self) -> Document:
        """Return the document if a scene is open without a project. Otherwise raise RequestRefused."""
        document = self.require_scene_open()
        if document.count(Kind.PROJECT):
            raise RequestRefused("The scene cannot be changed while a project is open: close the project first.")
        return document

    def require_project_open(self) -> Document:
        """Return the document if a project is open. Otherwise raise RequestRefused."""
        self.require_scene_open()
        if not self.document.count(Kind.PROJECT):
            raise RequestRefused("No project is open: open one first.")
        return self.document

    def require_nothing_open(self) -> None:
        """Raise RequestRefused if a scene or project is open."""
        if self.document.count(Kind.PROJECT):
            raise RequestRefused("The project {name} is open: close it first.", name=self._name(Kind.PROJECT))
        if self.document.count(Kind.SCENE):
            raise RequestRefused("The scene {name} is open: close it first.", name=self._name(Kind.SCENE))

    def bare_scene(self) -> BareScene:
        """Return the open scene without its objects."""
        scene = self.document.of_kind(Kind.SCENE)[0].value
        return replace(reduce_to(BareScene, scene), **self._scene_times.fields())

    def bare_project(self) -> BareProject:
        """Return the open project without its content."""
        project = self.document.of_kind(Kind.PROJECT)[0].value
        return replace(reduce_to(BareProject, project), **self._project_times.fields())

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
        """Whether closing would lose unsaved changes."""
        return self.scene_changed or self.project_changed

    def greeting(self, state: SceneStateEnum) -> list[Event]:
        """Return the events that describe the open document to a new connection; empty if nothing is open.

        Args:
            state: whether the scene is online.
        """
        if (scene := self.scene) is None:
            return []
        scene_state = make_event("SceneState", SceneStateData(state))
        if (project := self.project) is not None:
            return [make_event("OpenProject", OpenProjectData(scene, project)), scene_state]
        return [make_event("OpenScene", OpenSceneData(scene)), scene_state]

    def _name(self, kind: Kind) -> str | None:
        return next((item.value.name for item in self.document.of_kind(kind)), None)

    def _forget_snapshots(self) -> None:
        self._scene = None
        self._project = None

    # ------------------------------------------------------------------------------------------ look-ups
    def root_of(self, item: str) -> str:
        """Return the root of the lock tree that an id belongs to. Raise NotFound if there is none."""
        return self.document.root_of(item)

    def name_of(self, item: str) -> str:
        """Return the name of an item of the open document; empty if there is no such item."""
        found = next((each for kind in Kind if (each := self.document.find(kind, item)) is not None), None)
        return "" if found is None else str(getattr(found.value, "name", ""))

    def tree_of(self, root: str) -> list[str]:
        """Return the ids below a root of a lock tree."""
        return self.document.tree_of(root)
