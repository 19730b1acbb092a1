"""The viewer's default layout of a recording: the flight, its figures and its events."""

import numpy as np
import rerun.blueprint as rrb

from worldsim.recording import layout

TRAIL_S = 4.0
BACKGROUND = (13, 17, 24)
EYE_DIRECTION = np.array([-0.8, -1.0, 0.5])  # from the centre of view [world axes]
EYE_DISTANCE = 2.2  # [radii of the team]; a ball of this radius fills the height of the view


def blueprint_of(obstacles: bool = False) -> rrb.Blueprint:
    """Return the viewer's default layout; obstacles: whether there are any."""
    main = rrb.Vertical(_flight_view(), _event_view(), row_shares=[4, 1])
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


def _flight_view() -> rrb.Spatial3DView:
    """Return the 3D view, drawn in the team's frame: it follows the team and keeps it in view."""
    direction = EYE_DIRECTION / np.linalg.norm(EYE_DIRECTION)
    return rrb.Spatial3DView(
        origin=layout.TEAM,
        contents=f"{layout.WORLD}/**",
        name="Flight",
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=EYE_DISTANCE * direction,
            look_target=(0, 0, 0),
            eye_up=(0, 0, 1),
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
    """Return the list of events: their text begins with the time, which the viewer would cut."""
    times = [
        rrb.encodings.TimelineColumn(timeline, visible=False)
        for timeline in (layout.SIM_TIME, layout.TICK)
    ]
    columns = rrb.TextLogColumns(timeline_columns=times, text_log_columns=["LogLevel", "Body"])
    listed = rrb.TextLogRows(filter_by_log_level=["CRITICAL", "ERROR", "WARN", "INFO"])
    return rrb.TextLogView(origin=layout.EVENTS, name="Events", columns=columns, rows=listed)


def _series(name: str, origin: str) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(origin=origin, name=name, plot_legend=rrb.PlotLegend(visible=False))
