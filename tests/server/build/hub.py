"""The parts of a server that Build and import need: real storage, assets and registry, and no open project."""

import contextlib
import types
from collections.abc import AsyncIterator, Iterable, Mapping
from pathlib import Path
from typing import Any

import pytest
from msgspec import UNSET

from arcor2_hw.analysis import InstalledType, SourceFile
from arcor2_hw.data.object_type import ObjectModel, ObjectTypeSource
from arcor2_server.build.importing import PackageImport
from arcor2_server.build.service import BuildService
from arcor2_server.object_types.catalog import KnownTypes, PackageType
from arcor2_server.object_types.notifications import TypeNotifications
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import AssetStore, Storage


@contextlib.asynccontextmanager
async def opened(
    directory: Path,
    code: Iterable[PackageType],
    monkeypatch: pytest.MonkeyPatch,
    models: Mapping[str, ObjectModel] | None = None,
) -> AsyncIterator[Any]:
    """Yield services whose storage contains the types that have a source. The other types are installed."""
    settings = ServerSettings(data_dir=directory)
    settings.data_dir.mkdir(parents=True)
    storage = await Storage.open(settings)
    try:
        installed = []
        for one in code:
            if one.source:
                model = UNSET if models is None else models.get(one.name, UNSET)
                await storage.put_object_type(ObjectTypeSource(one.name, one.source, model=model))
            else:
                module = one.entry_point.partition(":")[0]
                path = Path(str(one.folder)) / f"{module.rpartition('.')[2]}.py"
                file = SourceFile(one.name, module, path.read_text(), str(path))
                installed.append(
                    InstalledType(one.name, one.entry_point, one.distribution, one.version, str(one.folder), file)
                )
        monkeypatch.setattr("arcor2_server.object_types.registry.installed_types", lambda: installed)
        assets = await AssetStore.open(directory / "assets")
        object_types = ObjectTypes(KnownTypes(), storage, assets)
        await object_types.load()
        events: list[Any] = []
        services: Any = types.SimpleNamespace(
            settings=settings,
            storage=storage,
            assets=assets,
            types=object_types,
            session=types.SimpleNamespace(scene=None, project=None),
            hub=types.SimpleNamespace(broadcast=events.append, events=events),
        )
        services.build = BuildService(settings, storage, object_types)
        services.type_notifications = TypeNotifications(object_types, services.hub)
        services.package_import = PackageImport(
            storage, assets, object_types, services.session, services.type_notifications
        )
        try:
            yield services
        finally:
            await services.type_notifications.close()
    finally:
        await storage.close()
