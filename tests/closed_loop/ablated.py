"""Controllers of which a part of the Q-structure is switched off, to show what it carries."""

import msgspec

from agent.guidance.q_structure import QStructure
from agent.structure.member import StructureMember
from agent.structure.structure import Structure


class _Distressed(Structure):
    """A structure without tiers: nobody states one, not even a root."""

    def follow_trees(self, view, senses):
        super().follow_trees(view, senses)
        for tree in self.trees:
            tree.parent = tree.tier = -1


class _Mute(Structure):
    """A structure in which leaders say nothing of their queues."""

    def summary(self, now_s):
        found = super().summary(now_s)
        if found is None:
            return None
        trees = tuple(msgspec.structs.replace(report, down=None) for report in found.trees)
        return msgspec.structs.replace(found, trees=trees)


class WithoutTiers(QStructure):
    """The Q-structure without tiers."""

    def __init__(self, setup):
        super().__init__(setup)
        self._places = StructureMember(setup, _Distressed)


class MuteLeaders(QStructure):
    """The Q-structure with mute leaders."""

    def __init__(self, setup):
        super().__init__(setup)
        self._places = StructureMember(setup, _Mute)
