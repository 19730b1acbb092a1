"""How a recording looks when it is opened: the flight, its figures, its events."""

from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from worldsim.recording import layout
from worldsim.scenario.start import BoxStart
from worldsim.scenario.tables import Scenario

TRAIL_S = 4.0
BACKGROUND = (13, 17, 24)
GRID = (38, 46, 60)
EYE_FROM = np.array([-0.8, -1.0, 0.5])
EYE_DISTANCE = 1.2


@dataclass(frozen=True, slots=True)
class Stage:
    """What the eye must hold at first sight: a ball, ``centre`` and ``radius`` [m; world frame]."""

    centre: NDArray[np.float64]
    radius: float


def stage_of(scenario: Scenario, slots: NDArray[np.float64]) -> Stage:
    """Return the ball around a scenario's start and its formation's slots (N, 3) [m; world]."""
    points = np.vstack([_start_corners(scenario), slots])
    low, high = points.min(axis=0), points.max(axis=0)
    centre = ((low + high) / 2.0 + slots.mean(axis=0)) / 2.0
    return Stage(centre, max(float(np.linalg.norm(high - low)) / 2.0, 1.0))


def blueprint_of(stage: Stage, obstacles: bool = False) -> rrb.Blueprint:
    """Return the viewer's default layout; ``obstacles``: whether there are any."""
    near = [_series("Distance to the nearest obstacle [m]", layout.OBSTACLE_DISTANCE)]
    flight = rrb.Vertical(
        _series("Separation to the nearest other [m]", layout.SEPARATION),
        *(near if obstacles else ()),
        _series("Distance to the own slot [m]", layout.SLOT_ERROR),
        _series("Force |u|", layout.FORCE),
        _series("Wanted turn [deg]", layout.TURN_DEG),
        name="Flight",
    )
    team = rrb.Vertical(
        _series("Residual of each queue [m]", layout.QUEUE_RESIDUAL),
        _series("Tier (-1: in distress)", layout.TIER),
        _series("Oldest record kept of a member [s]", layout.RECORD_AGE),
        _series("Neighbours heard directly", layout.NEIGHBOURS),
        rrb.StateTimelineView(origin=layout.ROLES, name="Role"),
        row_shares=[1, 1, 1, 1, 2],
        name="Team",
    )
    main = rrb.Vertical(
        _flight(stage),
        rrb.TextLogView(
            origin=layout.EVENTS,
            name="Events",
            columns=rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"]),
        ),
        row_shares=[4, 1],
    )
    return rrb.Blueprint(
        rrb.Horizontal(main, rrb.Tabs(flight, team), column_shares=[2, 1]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=layout.SIM_TIME, playback_speed=1.0),
    )


def _flight(stage: Stage) -> rrb.Spatial3DView:
    eye = stage.centre + EYE_DISTANCE * stage.radius * EYE_FROM / np.linalg.norm(EYE_FROM)
    ground = float(stage.centre[2] - stage.radius * 0.75)
    return rrb.Spatial3DView(
        origin="/world",
        name="Flight",
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(
            visible=True,
            spacing=1.0,
            stroke_width=1.0,
            color=GRID,
            plane=rr.components.Plane3D.XY.with_distance(ground),
        ),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=eye, look_target=stage.centre, eye_up=(0, 0, 1)
        ),
        overrides={layout.AGENTS: _trail()},
    )


def _trail() -> rrb.VisibleTimeRanges:
    """Return the range that shows where agents were of late: it costs the recording nothing."""
    boundary = rrb.TimeRangeBoundary
    trail = rrb.VisibleTimeRange(
        layout.SIM_TIME,
        start=boundary.cursor_relative(seconds=-TRAIL_S),
        end=boundary.cursor_relative(),
    )
    return rrb.VisibleTimeRanges([trail])


def _series(name: str, origin: str) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(origin=origin, name=name, plot_legend=rrb.PlotLegend(visible=False))


def _start_corners(scenario: Scenario) -> NDArray[np.float64]:
    start = scenario.fleet.start
    if not isinstance(start, BoxStart):
        return np.array(start.positions_m, dtype=np.float64)
    centre, half = np.array(start.centre_m), np.array(start.size_m) / 2.0
    return np.stack([centre - half, centre + half])
