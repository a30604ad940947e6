"""Requests about recipes, their release, and the changeover (docs/protocol/recipes.md)."""

from dataclasses import dataclass

from arcor2_hw.data.recipes import Changeover, Recipe, RecipeComparison
from arcor2_hw.data.rpc import (
    CompareRecipesArgs,
    IdArgs,
    ListRecipesArgs,
    ListRecipesData,
    PackageParametersData,
    PutRecipeArgs,
    SignRecipeArgs,
)
from arcor2_server.execution.service import Execution
from arcor2_server.production.recipes import Recipes
from arcor2_server.rpc.registry import Context, rpc


@dataclass(frozen=True, slots=True)
class RecipeRequests:
    """Requests about recipes, their release, and the changeover (docs/protocol/recipes.md)."""

    _recipes: Recipes
    _execution: Execution

    @rpc("ListRecipes")
    async def list_recipes(self, context: Context, args: ListRecipesArgs | None) -> ListRecipesData:
        """Return recipes, and what the cell produces."""
        return ListRecipesData(self._recipes.find(args or ListRecipesArgs()), self._recipes.changeover)

    @rpc("GetPackageParameters")
    async def get_package_parameters(self, context: Context, args: IdArgs) -> PackageParametersData:
        """Return the constants and variables of a package whose values a recipe can set."""
        return PackageParametersData(await self._recipes.parameters(args.id))

    @rpc("PutRecipe")
    async def put_recipe(self, context: Context, args: PutRecipeArgs) -> Recipe:
        """Add a draft of a recipe, or change one."""
        return await self._recipes.put(args, context.client.name)

    @rpc("DeleteRecipe")
    async def delete_recipe(self, context: Context, args: IdArgs) -> None:
        """Delete a draft of a recipe."""
        await self._recipes.delete(args.id)

    @rpc("SignRecipe")
    async def sign_recipe(self, context: Context, args: SignRecipeArgs) -> Recipe:
        """Sign a recipe, which sets its state."""
        client = context.client
        return await self._recipes.sign(args, client.device, "" if client.person is None else client.person.id)

    @rpc("CompareRecipes")
    async def compare_recipes(self, context: Context, args: CompareRecipesArgs) -> RecipeComparison:
        """Compare two recipes and their packages."""
        return await self._recipes.compare(args.before, args.after)

    @rpc("ChangeOver")
    async def change_over(self, context: Context, args: IdArgs) -> Changeover:
        """Let the cell produce another recipe."""
        self._execution.require_no_program()
        return await self._recipes.change_over(args.id, context.client.name)
