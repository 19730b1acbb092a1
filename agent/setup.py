"""What an agent is told before it flies, under the name that a controller of one's own imports."""

from agent.config import AgentSetup

__all__ = ["AgentSetup"]
