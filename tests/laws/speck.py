"""The smallest formation there is, for tests that fly none."""

from agent.qstructure.formation import FormationSpec, QueueSpec
from agent.qstructure.shape import Ray

SPECK = FormationSpec(
    name="speck",
    vertices={"V1": (0.0, 0.0, 0.0)},
    queue=(QueueSpec(name="Q1", vertices=("V1",), shape=Ray(direction=(1, 0, 0))),),
)
