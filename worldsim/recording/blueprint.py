"""The viewer's default layout of a recording: the flight, its figures and its events."""

from dataclasses import dataclass
from typing import assert_never

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from worldsim.recording import layout
from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.tables import Scenario

TRAIL_S = 4.0
BACKGROUND = (13, 17, 24)
GRID = (38, 46, 60)
EYE_DIRECTION = np.array([-0.8, -1.0, 0.5])  # from the centre of view [world axes]
EYE_DISTANCE = 1.2  # [radii of the region in view]


@dataclass(frozen=True, slots=True)
class ViewRegion:
    """The ball that the camera shows when a recording is opened."""

    centre: NDArray[np.float64]  # (3,) [m; world frame]
    radius_m: float


def view_region(scenario: Scenario, slots: NDArray[np.float64]) -> ViewRegion:
    """Return a ball around a scenario's start and its slots (M, 3) [m; world frame]."""
    points = np.vstack([_start_corners(scenario.fleet.start), slots])
    low, high = points.min(axis=0), points.max(axis=0)
    centre = ((low + high) / 2.0 + slots.mean(axis=0)) / 2.0
    return ViewRegion(centre, radius_m=max(float(np.linalg.norm(high - low)) / 2.0, 1.0))


def blueprint_of(region: ViewRegion, obstacles: bool = False) -> rrb.Blueprint:
    """Return the viewer's default layout; obstacles: whether there are any."""
    main = rrb.Vertical(_flight_view(region), _event_view(), row_shares=[4, 1])
    tabs = rrb.Tabs(_motion_tab(obstacles), _hierarchy_tab())
    return rrb.Blueprint(
        rrb.Horizontal(main, tabs, column_shares=[2, 1]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=layout.SIM_TIME, playback_speed=1.0),
    )


def _motion_tab(obstacles: bool) -> rrb.Vertical:
    distance = [_series("Distance to nearest obstacle [m]", layout.OBSTACLE_DISTANCE)]
    return rrb.Vertical(
        _series("Distance to nearest vehicle [m]", layout.SEPARATION),
        *(distance if obstacles else ()),
        _series("Distance to own slot [m]", layout.SLOT_ERROR),
        _series("Control force |u|", layout.FORCE),
        _series("Desired turn [deg]", layout.TURN_DEG),
        name="Motion",
    )


def _hierarchy_tab() -> rrb.Vertical:
    return rrb.Vertical(
        _series("Largest slot distance in each queue [m]", layout.QUEUE_RESIDUAL),
        _series("Tier (-1: in distress)", layout.TIER),
        _series("Age of oldest team record [s]", layout.RECORD_AGE),
        _series("Number of direct neighbours", layout.NEIGHBOURS),
        rrb.StateTimelineView(origin=layout.ROLES, name="Role"),
        row_shares=[1, 1, 1, 1, 2],
        name="Hierarchy",
    )


def _flight_view(region: ViewRegion) -> rrb.Spatial3DView:
    direction = EYE_DIRECTION / np.linalg.norm(EYE_DIRECTION)
    eye = region.centre + EYE_DISTANCE * region.radius_m * direction
    ground_m = float(region.centre[2] - region.radius_m * 0.75)
    return rrb.Spatial3DView(
        origin=layout.WORLD,
        name="Flight",
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(
            visible=True,
            spacing=1.0,
            stroke_width=1.0,
            color=GRID,
            plane=rr.components.Plane3D.XY.with_distance(ground_m),
        ),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=eye, look_target=region.centre, eye_up=(0, 0, 1)
        ),
        overrides={layout.AGENTS: _trail()},
    )


def _trail() -> rrb.VisibleTimeRanges:
    """Return the time range that draws trails; recorded trails would cost far more."""
    boundary = rrb.TimeRangeBoundary
    trail = rrb.VisibleTimeRange(
        layout.SIM_TIME,
        start=boundary.cursor_relative(seconds=-TRAIL_S),
        end=boundary.cursor_relative(),
    )
    return rrb.VisibleTimeRanges([trail])


def _event_view() -> rrb.TextLogView:
    columns = rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"])
    return rrb.TextLogView(origin=layout.EVENTS, name="Events", columns=columns)


def _series(name: str, origin: str) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(origin=origin, name=name, plot_legend=rrb.PlotLegend(visible=False))


def _start_corners(start: BoxStart | ListStart) -> NDArray[np.float64]:
    """Return points (K, 3) [m; world frame] whose bounding box holds the start."""
    match start:
        case BoxStart():
            centre, half = np.array(start.centre_m), np.array(start.size_m) / 2.0
            return np.stack([centre - half, centre + half])
        case ListStart():
            return np.array(start.positions_m, dtype=np.float64)
        case _:
            assert_never(start)
