"""Recipes: drafts, signatures, changeover, and the check before a run."""

import asyncio
from collections.abc import Mapping
from itertools import islice
from typing import Any, Final

import msgspec
import structlog
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Data, Unset, new_id, now
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.project import ProjectParameter
from arcor2_hw.data.recipes import (
    MEANINGS,
    ChangedFile,
    ChangedValue,
    Changeover,
    FileChange,
    Recipe,
    RecipeComparison,
    RecipeState,
    RecipeValue,
    Signature,
    UsedRecipe,
)
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import ListRecipesArgs, PutRecipeArgs, SignRecipeArgs
from arcor2_hw.exceptions import Arcor2Error, InvalidData, NotFound
from arcor2_hw.messages import Message, translatable
from arcor2_server.audit import changes as audit
from arcor2_server.collaboration.persons import Persons
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub, make_event
from arcor2_server.execution.runs import RunStart
from arcor2_server.storage.packages import Packages
from arcor2_server.storage.persons import StoredPerson
from arcor2_server.storage.recipes import RecipeStore, StoredChangeover

log = structlog.get_logger(__name__)

_NEXT: Final[Mapping[RecipeState, frozenset[RecipeState]]] = {
    RecipeState.DRAFT: frozenset({RecipeState.TESTED}),
    RecipeState.TESTED: frozenset({RecipeState.RELEASED, RecipeState.RETIRED}),
    RecipeState.RELEASED: frozenset({RecipeState.RETIRED}),
    RecipeState.RETIRED: frozenset(),
}
"""The states that a signature may set, by the present state."""
_SIGNER: Final = {
    RecipeState.TESTED: Role.ADVANCED_USER,
    RecipeState.RELEASED: Role.TECHNICIAN,
    RecipeState.RETIRED: Role.TECHNICIAN,
}
"""Minimum role of the signing person, by the state that the signature sets."""
_STATES: Final[Mapping[RecipeState, str]] = translatable(
    {
        RecipeState.DRAFT: "a draft",
        RecipeState.TESTED: "tested",
        RecipeState.RELEASED: "released",
        RecipeState.RETIRED: "retired",
    }
)
_TYPES: Final[Mapping[str, type]] = {"boolean": bool, "double": float, "integer": int, "string": str}
"""The types of project parameters whose values a recipe can set."""
_HISTORY: Final = 100
"""Number of changeovers that are searched for the previous recipe."""
_MAX_DIFF: Final = 2000
"""Maximum number of lines of a comparison of scripts."""


class _AuditedRecipe(Data, frozen=True):
    """A change of a recipe in the audit trail."""

    kind: str
    id: str
    before: Any
    after: Any


class Recipes:
    """The recipes of the cell. All methods may raise StorageError.

    Args:
        hub: publishes RecipeChanged and ChangeoverChanged.
        store: stores recipes and changeovers.
        packages: the packages.
        persons: check the PINs of signatures.
        released_only: whether operators may run only released recipes.
    """

    def __init__(
        self, hub: EventHub, store: RecipeStore, packages: Packages, persons: Persons, *, released_only: bool
    ) -> None:
        self._hub = hub
        self._store = store
        self._packages = packages
        self._persons = persons
        self._released_only = released_only
        self._recipes: dict[str, Recipe] = {}
        self._changeovers: list[StoredChangeover] = []
        """Newest first."""
        self._changing = asyncio.Lock()

    async def open(self) -> None:
        """Read the stored recipes. Raise StorageError if they cannot be read."""
        self._recipes = {recipe.id: recipe for recipe in await self._store.all()}
        self._changeovers = await self._store.changeovers(_HISTORY)

    # -------------------------------------------------------------------------------- queries
    def find(self, args: ListRecipesArgs) -> list[Recipe]:
        """Return recipes by product, newest revision first."""
        found = (
            recipe
            for recipe in self._recipes.values()
            if args.product in (UNSET, recipe.product) and args.state in (UNSET, recipe.state)
        )
        return sorted(found, key=lambda each: (each.product.casefold(), -each.revision))

    def get(self, key: str) -> Recipe:
        """Return a recipe. Raise NotFound if there is none."""
        if (recipe := self._recipes.get(key)) is None:
            raise NotFound("The recipe {key!r} does not exist.", key=key)
        return recipe

    @property
    def changeover(self) -> Changeover:
        """The present recipes of the cell, without deleted ones."""
        known = [each for each in self._changeovers if each.recipe_id in self._recipes]
        if not known:
            return Changeover(self._released_only)
        present = known[0]
        previous = next((each.recipe_id for each in known if each.recipe_id != present.recipe_id), UNSET)
        return Changeover(self._released_only, present.recipe_id, previous, present.by, present.at)

    async def parameters(self, package_id: str) -> list[ProjectParameter]:
        """Return the constants and variables of a package whose values a recipe can set.

        Raises:
            NotFound: the package does not exist.
            InvalidPackage: its project cannot be read.
        """
        project = await asyncio.to_thread(self._packages.project, package_id)
        return [each for each in project.parameters if each.type in _TYPES]

    async def compare(self, before: str, after: str) -> RecipeComparison:
        """Compare two recipes with their packages. Raise NotFound if one does not exist."""
        one, other = self.get(before), self.get(after)
        values = {each.name: each.value for each in one.values}, {each.name: each.value for each in other.values}
        differing = [
            ChangedValue(name, values[0].get(name, UNSET), values[1].get(name, UNSET))
            for name in dict.fromkeys((*values[0], *values[1]))
            if values[0].get(name) != values[1].get(name)
        ]
        problems = [str(problem) for each in (one, other) if (problem := await self._problem(each)) is not None]
        files, script = await asyncio.to_thread(self._compare_packages, one.package_id, other.package_id)
        return RecipeComparison(one, other, differing, files, script, problems)

    def _compare_packages(self, before: str, after: str) -> tuple[list[ChangedFile], str]:
        try:
            digests = self._packages.file_digests(before), self._packages.file_digests(after)
            former, present = (self._packages.script(each).splitlines(keepends=True) for each in (before, after))
        except Arcor2Error:
            return [], ""  # stated by the problems
        files = [
            ChangedFile(
                path,
                FileChange.ADDED
                if path not in digests[0]
                else FileChange.REMOVED
                if path not in digests[1]
                else FileChange.CHANGED,
            )
            for path in sorted({*digests[0], *digests[1]})
            if digests[0].get(path) != digests[1].get(path)
        ]
        import difflib  # not needed at the start of the server

        lines = difflib.unified_diff(former, present, "script.py", "script.py")
        return files, "".join(islice(lines, _MAX_DIFF))

    # -------------------------------------------------------------------------------- drafts
    async def put(self, args: PutRecipeArgs, by: str) -> Recipe:
        """Add a draft, or change one.

        Raises:
            NotFound: the draft or the package does not exist.
            RequestRefused: the recipe is not a draft.
            InvalidData: a value is unknown or not acceptable.
        """
        async with self._changing:
            before = None if isinstance(args.id, Unset) else self.get(args.id)
            if before is not None and before.state is not RecipeState.DRAFT:
                raise RequestRefused(
                    "{recipe} is {state} and cannot be changed. Add a new revision.",
                    recipe=before.shown,
                    state=Message.of(_STATES[before.state]),
                )
            values = await self._checked(args)
            digest = await asyncio.to_thread(self._packages.digest, args.package_id)
            recipe = Recipe(
                new_id("rcp") if before is None else before.id,
                args.product.strip(),
                self._revision(args.product.strip(), before),
                args.package_id,
                digest,
                RecipeState.DRAFT,
                now() if before is None else before.created,
                by,
                values,
                args.planned_rate,
                args.note,
            )
            if not recipe.product:
                raise InvalidData("A recipe needs the name of a product.")
            await self._store.put(recipe)
            self._changed(before, recipe)
        return recipe

    def _revision(self, product: str, before: Recipe | None) -> int:
        if before is not None and before.product == product:
            return before.revision
        return max((each.revision for each in self._recipes.values() if each.product == product), default=0) + 1

    async def _checked(self, args: PutRecipeArgs) -> list[RecipeValue]:
        """Return the values of a recipe. Raise InvalidData if one is not acceptable."""
        known = {each.name: each for each in await self.parameters(args.package_id)}
        seen: set[str] = set()
        for each in args.values:
            if each.name in seen:
                raise InvalidData("The value {name} is given twice.", name=each.name)
            seen.add(each.name)
            if each.name not in known:
                raise InvalidData("The package has no constant or variable {name}.", name=each.name)
            limited = not (isinstance(each.min, Unset) and isinstance(each.max, Unset))
            if limited and known[each.name].type not in ("double", "integer"):
                raise InvalidData("{name} is not a number and cannot have limits.", name=each.name)
            if not (isinstance(each.min, Unset) or isinstance(each.max, Unset)) and each.min > each.max:
                raise InvalidData("The limits of {name} are reversed.", name=each.name)
            _check(known[each.name], each.value, each)
        return args.values

    async def delete(self, key: str) -> None:
        """Delete a draft. Raise NotFound if there is none, RequestRefused for another state."""
        async with self._changing:
            recipe = self.get(key)
            if recipe.state is not RecipeState.DRAFT:
                raise RequestRefused(
                    "{recipe} is {state} and cannot be deleted. Retire it.",
                    recipe=recipe.shown,
                    state=Message.of(_STATES[recipe.state]),
                )
            await self._store.delete(key)
            del self._recipes[key]
            self._changed(recipe, None)

    # -------------------------------------------------------------------------------- signatures
    async def sign(self, args: SignRecipeArgs, device: str, logged_on: str) -> Recipe:
        """Sign a recipe and set its state.

        Args:
            args: the recipe, its new state, and the person with their PIN.
            device: device on which the PIN was entered.
            logged_on: id of the person who is logged on at this device; empty if nobody is.

        Raises:
            NotFound: the recipe or the person does not exist.
            LogOnRefused: the PIN is wrong, or the person is locked out.
            RequestRefused: the person may not sign, the state cannot follow, or the package or recipe was changed.
        """
        recipe = self.get(args.id)
        if args.state not in _NEXT[recipe.state]:
            raise RequestRefused(
                "{recipe} is {state}; it cannot become {wanted}.",
                recipe=recipe.shown,
                state=Message.of(_STATES[recipe.state]),
                wanted=Message.of(_STATES[args.state]),
            )
        if logged_on not in ("", args.person):
            raise RequestRefused("The person who is logged on at this device has to sign.")
        person = await self._persons.check_pin(args.person, args.pin, device)
        least = _SIGNER[args.state]
        if person.role < least:
            raise RequestRefused(
                "{name} may not sign this. It needs the role {role} or a higher one.",
                name=person.name,
                role=least.shown,
            )
        async with self._changing:
            if self.get(args.id) != recipe:
                raise RequestRefused("{recipe} was changed in the meantime. Check it again.", recipe=recipe.shown)
            # A recipe can be retired also after its package was changed or deleted.
            problem = self._manipulated(recipe) if args.state is RecipeState.RETIRED else await self._problem(recipe)
            if problem is not None:
                raise RequestRefused(problem)
            signed = replace(
                recipe,
                state=args.state,
                signatures=[*recipe.signatures, self._signature(recipe, args.state, person, args.note)],
            )
            await self._store.put(signed)
            self._changed(recipe, signed)
        log.warning("recipe signed", recipe=signed.shown, state=args.state.value, by=person.name)
        return signed

    @staticmethod
    def _signature(recipe: Recipe, state: RecipeState, person: StoredPerson, note: str) -> Signature:
        before = recipe.signatures[-1].digest if recipe.signatures else ""
        unsigned = Signature(state, person.id, person.name, person.role.identifier, now(), MEANINGS[state], note)
        return replace(unsigned, digest=recipe.digest_of(unsigned, before))

    @staticmethod
    def _manipulated(recipe: Recipe) -> Message | None:
        if recipe.is_intact():
            return None
        return Message.of(
            "{recipe} is not as it was signed: it was changed in the database. Add a new revision.", recipe=recipe.shown
        )

    async def _problem(self, recipe: Recipe) -> Message | None:
        """Return why a recipe cannot be used: it or its package was changed or deleted. None if it can be used."""
        if (manipulated := self._manipulated(recipe)) is not None:
            return manipulated
        try:
            digest = await asyncio.to_thread(self._packages.digest, recipe.package_id)
        except NotFound:
            return Message.of("The package of {recipe} no longer exists.", recipe=recipe.shown)
        if digest != recipe.package_hash:
            return Message.of(
                "The package of {recipe} was changed. Build it again and add a new revision.", recipe=recipe.shown
            )
        return None

    # -------------------------------------------------------------------------------- changeover
    async def change_over(self, key: str, by: str) -> Changeover:
        """Let the cell produce another recipe.

        Raises:
            NotFound: the recipe does not exist.
            RequestRefused: it is not released, or it or its package was changed.
        """
        recipe = self.get(key)
        if recipe.state is not RecipeState.RELEASED:
            raise RequestRefused(
                "{recipe} is {state}. Only released recipes are produced.",
                recipe=recipe.shown,
                state=Message.of(_STATES[recipe.state]),
            )
        if (problem := await self._problem(recipe)) is not None:
            raise RequestRefused(problem)
        changeover = StoredChangeover(key, by, now())
        await self._store.add_changeover(changeover)
        self._changeovers.insert(0, changeover)
        del self._changeovers[_HISTORY:]
        log.warning("changed over", recipe=recipe.shown, by=by)
        self._hub.broadcast(make_event("ChangeoverChanged", self.changeover))
        return self.changeover

    # -------------------------------------------------------------------------------- runs
    async def require_unused(self, package_id: str) -> None:
        """Raise RequestRefused if a tested or released recipe needs a package."""
        for recipe in self._recipes.values():
            if recipe.package_id == package_id and recipe.state in (RecipeState.TESTED, RecipeState.RELEASED):
                raise RequestRefused(
                    "The package belongs to {recipe}, which is {state}. Retire the recipe first.",
                    recipe=recipe.shown,
                    state=Message.of(_STATES[recipe.state]),
                )

    async def prepare_run(self, package_id: str, how: RunStart) -> RunStart:
        """Check the recipe of a run, and return the options of the run with its values.

        Raises:
            RequestRefused: the recipe cannot be used, or operators need a released one.
            InvalidData: a value is unknown or out of its limits.
            NotFound: the recipe or the package does not exist.
        """
        if self._released_only and how.by_plc and not how.recipe_id:  # a job names only the package
            released = [
                each
                for each in self._recipes.values()
                if each.package_id == package_id and each.state is RecipeState.RELEASED
            ]
            if released:
                how = replace(how, recipe_id=max(released, key=lambda each: each.revision).id)
        if not how.recipe_id:
            if how.recipe_values:
                raise RequestRefused("Values need a recipe.")
            if self._released_only and how.role <= Role.OPERATOR:
                raise RequestRefused("Operators run only released recipes on this cell. Choose a recipe.")
            return how
        recipe = self.get(how.recipe_id)
        if recipe.package_id != package_id:
            raise RequestRefused("{recipe} belongs to another package.", recipe=recipe.shown)
        if recipe.state is RecipeState.RETIRED:
            raise RequestRefused("{recipe} is retired.", recipe=recipe.shown)
        if self._released_only and how.role <= Role.OPERATOR and recipe.state is not RecipeState.RELEASED:
            raise RequestRefused(
                "{recipe} is {state}. Operators run only released recipes on this cell.",
                recipe=recipe.shown,
                state=Message.of(_STATES[recipe.state]),
            )
        if (problem := await self._problem(recipe)) is not None:
            raise RequestRefused(problem)
        values = {each.name: each.value for each in recipe.values}
        limits = {each.name: each for each in recipe.values}
        parameters = {each.name: each for each in await self.parameters(package_id)}
        for name, value in how.recipe_values.items():
            if name not in limits:
                raise InvalidData("{recipe} has no value {name}.", recipe=recipe.shown, name=name)
            if name in parameters and value != limits[name].value:
                _check(parameters[name], value, limits[name], fixed=True)
            values[name] = value
        used = UsedRecipe(
            recipe.id,
            recipe.product,
            recipe.revision,
            recipe.state,
            recipe.package_hash,
            values,
            recipe.planned_rate,
        )
        return replace(how, used=used, values={parameters[name].id: value for name, value in values.items()})

    def _changed(self, before: Recipe | None, after: Recipe | None) -> None:
        shown = after or before
        assert shown is not None
        if after is not None:
            self._recipes[after.id] = after
        audit.record([_AuditedRecipe("recipe", shown.id, before, after)])
        change = ChangeType.REMOVE if after is None else ChangeType.ADD if before is None else ChangeType.UPDATE
        self._hub.broadcast(make_event("RecipeChanged", shown, change))


def _check(parameter: ProjectParameter, text: str, limits: RecipeValue, *, fixed: bool = False) -> None:
    """Check a value of a recipe or a run.

    Args:
        parameter: the constant or variable of the project.
        text: the value, JSON.
        limits: the limits of the recipe.
        fixed: whether a value without limits may not differ.

    Raises:
        InvalidData: the value has another type or is out of its limits. The message names value and limits.
    """
    kind = _TYPES[parameter.type]
    try:
        value: Any = msgspec.json.decode(text, type=kind)
    except msgspec.MsgspecError as error:
        raise InvalidData(
            "{name} is of the type {type}: {reason}.", name=parameter.name, type=parameter.type, reason=error
        ) from error
    if fixed and isinstance(limits.min, Unset) and isinstance(limits.max, Unset):
        raise InvalidData(
            "The recipe fixes {name} at {value}. It has no limits within which it may differ.",
            name=parameter.name,
            value=limits.value,
        )
    bounds = [(limits.min, limits.max)]
    if not isinstance(parameter.range, Unset):
        bounds.append((parameter.range.min, parameter.range.max))
    for low, high in bounds:
        below = not isinstance(low, Unset) and value < low
        if below or (not isinstance(high, Unset) and value > high):
            raise InvalidData(
                "{name} is {value}; it must be {low} to {high}.",
                name=parameter.name,
                value=text,
                low="-∞" if isinstance(low, Unset) else f"{low:g}",
                high="∞" if isinstance(high, Unset) else f"{high:g}",
            )
