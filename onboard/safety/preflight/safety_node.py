"""A safety node that was heard once must be heard still, with power on."""

from config.fleet import Robot
from onboard.canbus.silence import silence
from onboard.safety.observations import Observations


def check(seen: Observations, settings: Robot) -> str | None:
    """Reason where the node is silent or the motor supply is off; None without a node."""
    node = seen.safety_node
    if node is None:
        return None
    if node.button or node.latched:
        return "safety node: emergency stop is latched: release the button and reset the node"
    if not node.power:
        return "safety node: the motor supply is off"
    limit_s = settings.failsafe.safety_node_lost.after_s
    return silence("safety node", "status", node.age_s, limit_s)
