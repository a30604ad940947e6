"""The database tables. Documents are stored as JSON; columns contain the fields for lists and look-ups."""

from typing import Any

from sqlalchemy import (
    BigInteger,
    Boolean,
    Dialect,
    Double,
    ForeignKey,
    Integer,
    LargeBinary,
    String,
    Text,
    TypeDecorator,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column
from sqlalchemy.types import TypeEngine

from arcor2_hw.exceptions import InvalidData


class StoredText(TypeDecorator[str]):
    """A text without the character NUL, which PostgreSQL cannot store. SQLite refuses it too, so that both do the same.

    Args:
        length: Maximum length in characters; None: not limited.
    """

    impl: TypeEngine[Any] | type[TypeEngine[Any]] = String
    cache_ok = True
    field = ""
    """The column and its table, for messages."""

    def __init__(self, length: int | None = None) -> None:
        super().__init__(length)
        self.length = length
        if length is None:
            self.impl = Text()

    def process_bind_param(self, value: str | None, dialect: Dialect) -> str | None:  # noqa: ARG002
        """Return the value. Raise InvalidData if it contains NUL."""
        if value is not None and "\0" in value:
            raise InvalidData("{field} contains the character NUL. Remove it.", field=self.field or "A text")
        return value


class Base(DeclarativeBase):
    """Base of all tables."""


class SceneRow(Base):
    """A saved scene."""

    __tablename__ = "scene"

    id: Mapped[str] = mapped_column(StoredText(255), primary_key=True)
    name: Mapped[str] = mapped_column(StoredText(), index=True)
    description: Mapped[str] = mapped_column(StoredText(), default="")
    created: Mapped[str] = mapped_column(StoredText(40))
    modified: Mapped[str] = mapped_column(StoredText(40))
    document: Mapped[bytes] = mapped_column(LargeBinary)


class ProjectRow(Base):
    """A saved project. No foreign key: other programs may delete its scene."""

    __tablename__ = "project"

    id: Mapped[str] = mapped_column(StoredText(255), primary_key=True)
    scene_id: Mapped[str] = mapped_column(StoredText(255), index=True)
    name: Mapped[str] = mapped_column(StoredText(), index=True)
    description: Mapped[str] = mapped_column(StoredText(), default="")
    has_logic: Mapped[bool] = mapped_column(Boolean, default=True)
    created: Mapped[str] = mapped_column(StoredText(40))
    modified: Mapped[str] = mapped_column(StoredText(40))
    document: Mapped[bytes] = mapped_column(LargeBinary)


class ProjectSourceRow(Base):
    """The script of a project that has no logic of its own."""

    __tablename__ = "project_source"

    id: Mapped[str] = mapped_column(ForeignKey("project.id", ondelete="CASCADE"), primary_key=True)
    script: Mapped[str] = mapped_column(StoredText())


class ObjectTypeRow(Base):
    """An uploaded object type: its module. `model_kind` is set if it has a collision model, of the same id.

    `modules`: sources of the modules that belong to it, by name, as JSON.
    """

    __tablename__ = "object_type"

    id: Mapped[str] = mapped_column(StoredText(255), primary_key=True)
    description: Mapped[str | None] = mapped_column(StoredText())
    source: Mapped[str] = mapped_column(StoredText())
    model_kind: Mapped[str | None] = mapped_column(StoredText(20))
    created: Mapped[str] = mapped_column(StoredText(40))
    modified: Mapped[str] = mapped_column(StoredText(40))
    modules: Mapped[bytes | None] = mapped_column(LargeBinary)


class ModelRow(Base):
    """A collision model; one per id."""

    __tablename__ = "model"

    id: Mapped[str] = mapped_column(StoredText(255), primary_key=True)
    kind: Mapped[str] = mapped_column(StoredText(20))
    document: Mapped[bytes] = mapped_column(LargeBinary)


class ProjectTablesRow(Base):
    """Parameters and overrides that REST stores next to a project, as JSON."""

    __tablename__ = "project_beside"

    id: Mapped[str] = mapped_column(ForeignKey("project.id", ondelete="CASCADE"), primary_key=True)
    parameters: Mapped[bytes] = mapped_column(LargeBinary, default=b"[]")
    object_parameters: Mapped[bytes] = mapped_column(LargeBinary, default=b"[]")


class ExecutionTokenRow(Base):
    """A token of the Execution service's table, which grants no access (docs/protocol.md)."""

    __tablename__ = "execution_token"

    id: Mapped[str] = mapped_column(StoredText(255), primary_key=True)
    name: Mapped[str] = mapped_column(StoredText())
    access: Mapped[bool] = mapped_column(Boolean, default=False)


class BreakpointsRow(Base):
    """The breakpoints with which a package is debugged: ids of action points, as JSON."""

    __tablename__ = "breakpoints"

    package_id: Mapped[str] = mapped_column(StoredText(255), primary_key=True)
    ids: Mapped[bytes] = mapped_column(LargeBinary)


class ViewValueRow(Base):
    """One view value as JSON. `user` is empty for shared values, `document` for values without a document."""

    __tablename__ = "view_value"

    user: Mapped[str] = mapped_column(StoredText(255), primary_key=True)
    document: Mapped[str] = mapped_column(StoredText(255), primary_key=True, index=True)
    key: Mapped[str] = mapped_column(StoredText(255), primary_key=True)
    value: Mapped[bytes] = mapped_column(LargeBinary)
    revision: Mapped[int] = mapped_column(BigInteger)


class SharedBreakpointsRow(Base):
    """The breakpoints that users share on a project: ids of action points and actions, as JSON, and who set them."""

    __tablename__ = "shared_breakpoints"

    project_id: Mapped[str] = mapped_column(StoredText(255), primary_key=True)
    ids: Mapped[bytes] = mapped_column(LargeBinary)
    user: Mapped[str] = mapped_column(StoredText(), default="")


class RunRow(Base):
    """One run of a package, as JSON."""

    __tablename__ = "run"

    number: Mapped[int] = mapped_column(Integer, primary_key=True, autoincrement=False)
    document: Mapped[bytes] = mapped_column(LargeBinary)


class RunTraceRow(Base):
    """The trace of one run, as JSON compressed by zlib."""

    __tablename__ = "run_trace"

    run: Mapped[int] = mapped_column(Integer, primary_key=True, autoincrement=False)
    document: Mapped[bytes] = mapped_column(LargeBinary)


class AlarmRow(Base):
    """A record of an alarm that an older server has stored, as JSON. The next start moves it to a file."""

    __tablename__ = "alarm"

    number: Mapped[int] = mapped_column(Integer, primary_key=True, autoincrement=False)
    document: Mapped[bytes] = mapped_column(LargeBinary)


class CalibrationRow(Base):
    """The record of one calibration, as JSON."""

    __tablename__ = "calibration"

    id: Mapped[str] = mapped_column(StoredText(255), primary_key=True)
    date: Mapped[str] = mapped_column(StoredText(40), index=True)
    kind: Mapped[str] = mapped_column(StoredText(40))
    object_id: Mapped[str] = mapped_column(StoredText(255), index=True)
    document: Mapped[bytes] = mapped_column(LargeBinary)


class RecipeRow(Base):
    """A revision of a recipe, as JSON."""

    __tablename__ = "recipe"

    id: Mapped[str] = mapped_column(StoredText(255), primary_key=True)
    document: Mapped[bytes] = mapped_column(LargeBinary)


class ChangeoverRow(Base):
    """A changeover of the cell to a recipe, as JSON."""

    __tablename__ = "changeover"

    number: Mapped[int] = mapped_column(Integer, primary_key=True, autoincrement=False)
    document: Mapped[bytes] = mapped_column(LargeBinary)


class UnitRow(Base):
    """The record of a unit, as JSON compressed by zlib; columns contain the fields for look-ups."""

    __tablename__ = "unit"

    number: Mapped[int] = mapped_column(Integer, primary_key=True, autoincrement=False)
    serial: Mapped[str] = mapped_column(StoredText(255), index=True)
    order_id: Mapped[str] = mapped_column(StoredText(255), index=True)
    product: Mapped[str] = mapped_column(StoredText(255))
    state: Mapped[str] = mapped_column(StoredText(20))
    entered: Mapped[str] = mapped_column(StoredText(40), index=True)
    left: Mapped[str | None] = mapped_column(StoredText(40), index=True)
    planned_rate: Mapped[float | None] = mapped_column(Double)
    document: Mapped[bytes] = mapped_column(LargeBinary)


class UnitRunRow(Base):
    """A run that worked on a unit."""

    __tablename__ = "unit_run"

    unit: Mapped[int] = mapped_column(Integer, primary_key=True, autoincrement=False)
    run: Mapped[int] = mapped_column(Integer, primary_key=True, autoincrement=False, index=True)


class CellTimeRow(Base):
    """A period in which the cell had one activity; s since the epoch."""

    __tablename__ = "cell_time"

    start: Mapped[float] = mapped_column(Double, primary_key=True)
    end: Mapped[float] = mapped_column(Double, index=True)
    activity: Mapped[str] = mapped_column(StoredText(20))


class PersonRow(Base):
    """A person who logs on at shared devices, as JSON. PIN and card are hashes."""

    __tablename__ = "person"

    id: Mapped[str] = mapped_column(StoredText(255), primary_key=True)
    document: Mapped[bytes] = mapped_column(LargeBinary)


class PersonLockOutRow(Base):
    """The number of wrong PINs of a person at a device; `until`: when the next try is possible, s since the epoch.

    `person` is empty for wrong cards.
    """

    __tablename__ = "person_lock_out"

    person: Mapped[str] = mapped_column(StoredText(255), primary_key=True)
    device: Mapped[str] = mapped_column(StoredText(255), primary_key=True)
    wrong: Mapped[int] = mapped_column(Integer)
    until: Mapped[float] = mapped_column(Double)


class DeviceRow(Base):
    """The card of a device of the workplace, as JSON."""

    __tablename__ = "device"

    object_id: Mapped[str] = mapped_column(StoredText(255), primary_key=True)
    document: Mapped[bytes] = mapped_column(LargeBinary)


class ParameterBackupRow(Base):
    """A backup of the parameters of a device: `info` without, `document` with the parameters, both as JSON."""

    __tablename__ = "parameter_backup"

    id: Mapped[str] = mapped_column(StoredText(255), primary_key=True)
    object_id: Mapped[str] = mapped_column(StoredText(255), index=True)
    info: Mapped[bytes] = mapped_column(LargeBinary)
    document: Mapped[bytes] = mapped_column(LargeBinary)


class OutboxRow(Base):
    """A unit that has left the cell and that the broker of the fleet has not stored yet.

    `number` grows and is never used again. `unit`: the number of the unit.
    """

    __tablename__ = "outbox"

    number: Mapped[int] = mapped_column(BigInteger, primary_key=True, autoincrement=False)
    unit: Mapped[int] = mapped_column(Integer, unique=True)


for _table in Base.metadata.tables.values():
    for _column in _table.columns:
        if isinstance(_column.type, StoredText):
            _column.type.field = f"{_column.name} of {_table.name}"
