"""Resources for scripts that ARCOR2 generated."""

from arcor2_hw.data.project import ActionPoint
from arcor2_hw.runtime import resources


class Resources(resources.Resources):
    """Resources with the method names that such scripts use (from general knowledge of ARCOR2)."""

    def bare_action_point(self, action_point_id: str) -> ActionPoint:
        """Return an action point with its position in world coordinates. Raises NotFound."""
        return self.action_point(action_point_id)
