"""State machines of the address space: their present states."""

from collections.abc import Mapping

from asyncua import ua

from arcor2_hw.opcua.space import UNKNOWN, Space, Tag


class StateMachine:
    """The variables of a finite state machine (OPC 10000-16).

    Args:
        current: its variable CurrentState.
        current_id: the identifier of this state.
        states: the states by their names.
    """

    def __init__(self, current: Tag, current_id: Tag, states: Mapping[str, ua.NodeId]) -> None:
        self._current, self._id, self._states = current, current_id, states

    @classmethod
    async def add(cls, space: Space, machine: ua.NodeId, states: Mapping[str, ua.NodeId]) -> "StateMachine":
        """Add the variables to an object that is a state machine."""
        current = await space.add_variable(
            machine,
            space.name("ua", "CurrentState"),
            None,
            ua.ObjectIds.LocalizedText,
            ua.ObjectIds.FiniteStateVariableType,
            status=UNKNOWN,
        )
        current_id = await space.add_property(current.node, space.name("ua", "Id"), None, ua.ObjectIds.NodeId)
        return cls(current, current_id, states)

    async def enter(self, state: str | None) -> None:
        """Set the state. None: the machine has no state because its parent is in another state."""
        if state is None:
            for tag in (self._current, self._id):
                await tag.write(None, ua.StatusCodes.BadStateNotActive)
        else:
            await self._current.write(ua.LocalizedText(state))
            await self._id.write(self._states[state])
