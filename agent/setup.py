"""The import path of AgentSetup for users' controllers; see agent.config."""

from agent.config import AgentSetup

__all__ = ["AgentSetup"]
