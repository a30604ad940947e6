"""Requests about recipes, their release, and the changeover (docs/protocol/recipes.md)."""

from typing import Annotated, Final

from msgspec import Meta, field

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.project import ProjectParameter
from arcor2_hw.data.recipes import Changeover, ProductName, Recipe, RecipeComparison, RecipeState, RecipeValue
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc
from arcor2_hw.data.rpc.general import IdArgs
from arcor2_hw.data.rpc.persons import Secret

RecipeNote = Annotated[str, Meta(max_length=500)]


class ListRecipesArgs(Data, frozen=True):
    """Arguments of ListRecipes: only those of a product, or in a state."""

    product: str | Unset = UNSET
    state: RecipeState | Unset = UNSET


class ListRecipesData(Data, frozen=True):
    """Answer to ListRecipes: recipes by product, newest revision first, and the present production of the cell."""

    recipes: list[Recipe]
    changeover: Changeover


class PutRecipeArgs(Data, frozen=True):
    """Arguments of PutRecipe: a new draft, or a draft to change.

    id: the draft; omitted for a new revision of the product.
    """

    product: ProductName
    package_id: str
    id: str | Unset = UNSET
    values: Annotated[list[RecipeValue], Meta(max_length=200)] = field(default_factory=list)
    planned_rate: Annotated[float, Meta(gt=0.0, le=1e6)] | Unset = UNSET
    note: RecipeNote = ""


class SignRecipeArgs(Data, frozen=True):
    """Arguments of SignRecipe: the new state, and the person who signs, with their PIN."""

    id: str
    state: RecipeState
    person: str
    pin: Secret
    note: RecipeNote = ""

    def __repr__(self) -> str:
        """Return the arguments without the PIN."""
        return f"SignRecipeArgs(id={self.id!r}, state={self.state!r}, person={self.person!r})"


class CompareRecipesArgs(Data, frozen=True):
    """Arguments of CompareRecipes: ids of two recipes."""

    before: str
    after: str


class PackageParametersData(Data, frozen=True):
    """Answer to GetPackageParameters: constants and variables of the project of a package, whose values can be set."""

    parameters: list[ProjectParameter]


RECIPE_RPCS: Final = (
    Rpc("ChangeOver", IdArgs, Changeover, Role.OPERATOR, additional=True),
    Rpc("CompareRecipes", CompareRecipesArgs, RecipeComparison, Role.OPERATOR, additional=True),
    Rpc("DeleteRecipe", IdArgs, None, Role.ADVANCED_USER, additional=True),
    Rpc("GetPackageParameters", IdArgs, PackageParametersData, Role.OPERATOR, additional=True),
    Rpc("ListRecipes", ListRecipesArgs, ListRecipesData, Role.OPERATOR, args_optional=True, additional=True),
    Rpc("PutRecipe", PutRecipeArgs, Recipe, Role.ADVANCED_USER, additional=True),
    Rpc("SignRecipe", SignRecipeArgs, Recipe, Role.ADVANCED_USER, additional=True),
)
"""Requests about recipes."""
