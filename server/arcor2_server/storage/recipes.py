"""Stores recipes, and the changeovers of the cell."""

from typing import Final

import msgspec
from sqlalchemy import delete, func, select

from arcor2_hw.data.base import Data, Timestamp
from arcor2_hw.data.recipes import Recipe
from arcor2_server.storage.models import ChangeoverRow, RecipeRow
from arcor2_server.storage.store import Storage


class StoredChangeover(Data, frozen=True):
    """A changeover to a recipe."""

    recipe_id: str
    by: str
    at: Timestamp


_encode: Final = msgspec.json.Encoder().encode
_decode: Final = msgspec.json.Decoder(Recipe).decode
_decode_changeover: Final = msgspec.json.Decoder(StoredChangeover).decode


class RecipeStore:
    """The stored recipes and changeovers. All methods may raise StorageError."""

    def __init__(self, storage: Storage) -> None:
        self._storage = storage

    async def all(self) -> list[Recipe]:
        """Return all recipes."""
        async with self._storage.reading() as session:
            rows = list(await session.scalars(select(RecipeRow)))
        return [self._storage.decoded(_decode, row) for row in rows]

    async def put(self, recipe: Recipe) -> None:
        """Store a recipe."""
        async with self._storage.writing(documents=False) as session:
            await self._storage.upsert(session, RecipeRow(id=recipe.id, document=_encode(recipe)))

    async def delete(self, key: str) -> None:
        """Delete a recipe."""
        async with self._storage.writing(documents=False) as session:
            await session.execute(delete(RecipeRow).where(RecipeRow.id == key))

    async def changeovers(self, limit: int) -> list[StoredChangeover]:
        """Return the newest changeovers, newest first."""
        async with self._storage.reading() as session:
            rows = await session.scalars(
                select(ChangeoverRow.document).order_by(ChangeoverRow.number.desc()).limit(limit)
            )
            return [_decode_changeover(document) for document in rows]

    async def add_changeover(self, changeover: StoredChangeover) -> None:
        """Store a changeover."""
        async with self._storage.writing(documents=False) as session:
            number = await session.scalar(select(func.max(ChangeoverRow.number))) or 0
            session.add(ChangeoverRow(number=number + 1, document=_encode(changeover)))
