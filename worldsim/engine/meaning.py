"""What an action means when it happens: whom it strikes, and what a clock then has to do."""

from agent.qstructure.formation import FormationSpec
from worldsim.engine.membership import Begin, Fail, Hold, Start, Stop, Team
from worldsim.scenario.timeline import (
    Action,
    Failing,
    Holding,
    Joining,
    Order,
    Revival,
    Strike,
    UponRadio,
)
from worldsim.truth.world import World

Deed = Stop | Hold | Fail | Start | Begin | UponRadio | Order
"""What a clock carries out between slots."""
Places = list[tuple[int, int] | None]


def deed_of(
    action: Action, team: Team, world: World, places: Places, formation: FormationSpec
) -> Deed:
    """Find out whom an action means now; places: what each last claimed, in a formation."""
    match action:
        case Strike():
            return team.struck(action, places, formation)
        case Holding():
            return team.held(action, places, formation)
        case Failing():
            return team.failed(action, places, formation)
        case Revival() | Joining():
            return _come(action, team, world)
    return action


def _come(action: Revival | Joining, team: Team, world: World) -> Start:
    position, time_s = world.fleet.position, world.time_s
    if isinstance(action, Revival):
        return team.revived(action, position, time_s)
    return team.joined(action, position, time_s)
