"""Recipes: the package and the values for a product, and the signatures by which it is released."""

import enum
import hashlib
from typing import Annotated, Any, Final

import msgspec
from msgspec import Meta, field

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.role import RoleName

ProductName = Annotated[str, Meta(min_length=1, max_length=100)]
OrderId = Annotated[str, Meta(max_length=100)]


class RecipeState(enum.StrEnum):
    """State of a recipe. Each state after the first one is reached by a signature."""

    DRAFT = "draft"
    TESTED = "tested"
    RELEASED = "released"
    RETIRED = "retired"


MEANINGS: Final = {
    RecipeState.TESTED: "Tested on this cell",
    RecipeState.RELEASED: "Released for production",
    RecipeState.RETIRED: "Retired from production",
}
"""What a signature means, by the state that it sets (21 CFR 11.50: name, time and meaning)."""


class RecipeValue(Data, frozen=True):
    """The value of a constant or variable of the project, JSON in a string.

    min, max: limits within which the value of a single run may differ; without both, it may not.
    """

    name: str
    value: str
    min: float | Unset = UNSET
    max: float | Unset = UNSET


class Signature(Data, frozen=True):
    """A signature of a person.

    state: the state that it sets. person, name, role: the person who signed. at: time. meaning: meaning of the
    signature. note: remark of the person. digest: SHA-256 of the recipe, the signature before, and all other fields.
    """

    state: RecipeState
    person: str
    name: str
    role: RoleName
    at: Timestamp
    meaning: str
    note: str = ""
    digest: str = ""


class Recipe(Data, frozen=True):
    """A revision of a recipe.

    revision: counts the recipes of the product, from 1. package_id, package_hash: the package, and the SHA-256 of its
    files. values: values that replace those of the package. planned_rate: planned parts per hour. signatures: the first
    one is the oldest.
    """

    id: str
    product: str
    revision: int
    package_id: str
    package_hash: str
    state: RecipeState
    created: Timestamp
    created_by: str = ""
    values: list[RecipeValue] = field(default_factory=list)
    planned_rate: float | Unset = UNSET
    note: str = ""
    signatures: list[Signature] = field(default_factory=list)

    @property
    def shown(self) -> str:
        """The name of the revision in messages."""
        return f"{self.product} {self.revision}"

    def content(self) -> dict[str, Any]:
        """Return what is signed."""
        return {
            "product": self.product,
            "revision": self.revision,
            "package_id": self.package_id,
            "package_hash": self.package_hash,
            "values": msgspec.to_builtins(self.values),
            "planned_rate": None if isinstance(self.planned_rate, Unset) else self.planned_rate,
            "note": self.note,
        }

    def digest_of(self, signature: Signature, before: str) -> str:
        """Return the digest of a signature.

        Args:
            signature: the signature; its own digest is not used.
            before: digest of the signature before; empty for the first one.
        """
        signed = msgspec.to_builtins(signature) | {"digest": before, "recipe": self.content()}
        return hashlib.sha256(msgspec.json.encode(signed, order="sorted")).hexdigest()

    def is_intact(self) -> bool:
        """Return whether the recipe, its state and its signatures are unchanged since they were signed."""
        before = ""
        for signature in self.signatures:
            if signature.digest != self.digest_of(signature, before):
                return False
            before = signature.digest
        return self.state is (self.signatures[-1].state if self.signatures else RecipeState.DRAFT)


class UsedRecipe(Data, frozen=True):
    """The recipe with which a program runs, or ran.

    values: all values of the recipe, JSON in a string, as used in this run. planned_rate: planned parts per hour.
    """

    id: str
    product: str
    revision: int
    state: RecipeState
    package_hash: str
    values: dict[str, str] = field(default_factory=dict)
    planned_rate: float | Unset = UNSET


class Changeover(Data, frozen=True):
    """The production of the cell: the recipe, and the previous one, to which it can be rolled back.

    released_only: whether operators may run only released recipes. by, at: the user and the time of the changeover.
    """

    released_only: bool
    recipe_id: str | Unset = UNSET
    previous_id: str | Unset = UNSET
    by: str = ""
    at: Timestamp | Unset = UNSET


class FileChange(enum.StrEnum):
    """How a file of a package differs."""

    ADDED = "added"
    REMOVED = "removed"
    CHANGED = "changed"


class ChangedFile(Data, frozen=True):
    """A file that differs between two packages."""

    path: str
    change: FileChange


class ChangedValue(Data, frozen=True):
    """A value that differs between two recipes, JSON in a string; omitted where it is missing."""

    name: str
    before: str | Unset = UNSET
    after: str | Unset = UNSET


class RecipeComparison(Data, frozen=True):
    """The differences of two recipes.

    script: unified diff of the scripts. problems: reasons why a recipe cannot be used, such as a changed package.
    """

    before: Recipe
    after: Recipe
    values: list[ChangedValue]
    files: list[ChangedFile]
    script: str
    problems: list[str] = field(default_factory=list)
