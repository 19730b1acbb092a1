"""The viewer's default layout of a recording: a tab for each question, each with its own view.

All 3D views are drawn in the team's frame, so they follow the team; each shows the layers that
answer its question and hides the others.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import rerun.blueprint as rrb
from rerun.encodings import EntityPath

from worldsim.recording import layout
from worldsim.recording.panels import FAULTS, FORMING, MOTION, NETWORK, QUESTIONS, STRUCTURE
from worldsim.scenario.tables import Scenario

Override = rrb.VisibleTimeRanges | rrb.EntityBehavior
TRAIL_S = 4.0
BACKGROUND = (13, 17, 24)
EYE_DIRECTION = np.array([-0.8, -1.0, 0.5])  # from the centre of view [world axes]
EYE_DISTANCE = 2.2  # [radii of the team]; a ball of this radius fills the height of the view

PANEL_SHARE, STATES_SHARE = 1.6, 2.4
"""Heights of the panel of words and of timelines of states [heights of a plot]."""

Plot = rrb.View | rrb.Tabs
"""A view, or some of which one is seen."""
ALL_EVENTS = ("CRITICAL", "ERROR", "WARN", "INFO")
FAULT_EVENTS = ("CRITICAL", "ERROR", "WARN")

LINK_LAYERS = (layout.LINKS, layout.LINKS_LOST, layout.LINKS_CUT)
FAULT_LAYERS = (layout.SIDES, layout.LINKS_CUT)
FORMATION_LAYERS = tuple(
    f"{formation}/{part}"
    for formation in (layout.FORMATION, layout.FORMATION_BEFORE)
    for part in (layout.SLOTS_PART, layout.SPHERES_PART, layout.QUEUES_PART)
)
GUIDANCE_LAYERS = (layout.TARGETS, layout.HIERARCHY)
ASKED_FOR = (
    layout.LINKS_OUT_OF_RANGE,
    layout.CAST_ZONES,
    layout.BOBBERS,
    layout.WAYS,
    layout.GUIDING_LINES,
    layout.CONSTELLATION,
    layout.RAYS,
)
"""Detail that every view hides."""
LAYERS = (
    *LINK_LAYERS,
    layout.BELIEFS,
    *ASKED_FOR,
    layout.SIDES,
    *FORMATION_LAYERS,
    *GUIDANCE_LAYERS,
)
"""What some views hide; all views show vehicles, obstacles, jams, and what stops vehicles."""
SHOWN = {
    MOTION: FORMATION_LAYERS,
    NETWORK: (*LINK_LAYERS, layout.BELIEFS, layout.SIDES),
    STRUCTURE: (*FORMATION_LAYERS, *GUIDANCE_LAYERS),
    FAULTS: (*FAULT_LAYERS, *FORMATION_LAYERS),
}
"""The layers that each tab's view shows."""


def blueprint_of(scenario: Scenario, signals: Sequence[str] = ()) -> rrb.Blueprint:
    """Return the viewer's default layout of a scenario's run.

    signals: the names of those that controllers state, as far as they are known.
    """
    forms = scenario.control.controller == FORMING
    tabs = {
        MOTION: _motion(bool(scenario.obstacle), forms, signals),
        NETWORK: _network(scenario.control.allocation == "assignment", forms),
        STRUCTURE: _structure(),
        FAULTS: _faults(),
    }
    return _layout([_page(question, plots) for question, plots in tabs.items()])


def blueprint_of_two(roots: Mapping[str, str]) -> rrb.Blueprint:
    """Return the layout of two runs side by side; roots: of the entities of each, by its name."""
    pages = [
        rrb.Horizontal(
            *(_column(question, name, root) for name, root in roots.items()),
            name=question.capitalize(),
        )
        for question in QUESTIONS
    ]
    return _layout(pages)


def _layout(pages: Sequence[rrb.Horizontal]) -> rrb.Blueprint:
    return rrb.Blueprint(
        rrb.Tabs(*pages, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=layout.SIM_TIME, playback_speed=1.0),
    )


def _column(question: str, name: str, root: str) -> rrb.Vertical:
    """Return one of two runs: its view, its plots, and its events."""
    plots: dict[str, list[rrb.View]] = {
        MOTION: [
            _series("Distance to nearest vehicle [m]", root + layout.SEPARATION),
            _series("Distance to own slot [m]", root + layout.SLOT_ERROR),
        ],
        NETWORK: [
            _series("Pairs of agents by link", root + layout.LINK_COUNTS, named=True),
            _series("Connectivity lambda_2 (0: the team is parted)", root + layout.LAMBDA2),
        ],
        STRUCTURE: [
            rrb.StateTimelineView(
                origin=root or "/",
                contents=[f"{root}{layout.PHASE}/**", f"{root}{layout.ROLES}/**"],
                name="Phase and roles",
            ),
        ],
        FAULTS: [rrb.StateTimelineView(origin=root + layout.CONDITIONS, name="What is in force")],
    }
    texts = rrb.Tabs(
        _event_view(ALL_EVENTS, root),
        rrb.TextDocumentView(origin=root + layout.VERDICT, name="Verdict"),
        rrb.TextDocumentView(origin=root + layout.panel_entity(question), name="What you see"),
        rrb.TextDocumentView(origin=root + layout.SCENARIO, name="Scenario"),
    )
    view = _flight_view(question, root, name)
    shares = [5, *([4.0 / len(plots[question])] * len(plots[question])), 2]
    return rrb.Vertical(view, *plots[question], texts, row_shares=shares)


def _page(question: str, plots: Sequence[Plot]) -> rrb.Horizontal:
    """Return a tab: its view over the events, and its panel of words over its plots."""
    panels = rrb.Tabs(
        rrb.TextDocumentView(origin=layout.panel_entity(question), name="What you see"),
        rrb.TextDocumentView(origin=layout.VERDICT, name="Verdict"),
        rrb.TextDocumentView(origin=layout.SCENARIO, name="Scenario"),
    )
    levels = FAULT_EVENTS if question in (NETWORK, FAULTS) else ALL_EVENTS
    main = rrb.Vertical(_flight_view(question), _event_view(levels), row_shares=[7, 2])
    shares = [STATES_SHARE if isinstance(plot, rrb.StateTimelineView) else 1 for plot in plots]
    side = rrb.Vertical(panels, *plots, row_shares=[PANEL_SHARE, *shares])
    return rrb.Horizontal(main, side, column_shares=[9, 5], name=question.capitalize())


def _motion(obstacles: bool, forms: bool, signals: Sequence[str]) -> list[Plot]:
    """Return plots of the motion; obstacles: whether there are any; forms: whether slots are."""
    slots = [_series("Distance to own slot [m]", layout.SLOT_ERROR)]
    distance = [_series("Distance to nearest obstacle [m]", layout.OBSTACLE_DISTANCE)]
    return [
        _series("Distance to nearest vehicle [m]", layout.SEPARATION),
        *(distance if obstacles else ()),
        *(slots if forms else ()),
        *_signal_plots(signals),
        rrb.Tabs(
            _series("Control force |u| [m/s]", layout.FORCE),
            _series("Wanted turn [deg], left positive", layout.TURN_DEG),
        ),
    ]


def _network(records: bool, forms: bool) -> list[Plot]:
    """Return plots of the network.

    records: whether agents keep records of their team. forms: whether the Q-structure flies.
    """
    ages = [_series("Age of oldest team record [s]", layout.RECORD_AGE)]
    return [
        _series("Pairs of agents by link", layout.LINK_COUNTS, named=True),
        _series("Connectivity lambda_2 (0: the team is parted)", layout.LAMBDA2),
        rrb.Tabs(
            _series("Neighbours heard", layout.NEIGHBOURS),
            _series(
                "Farthest that a neighbour is from where it is believed [m]", layout.BELIEF_ERROR
            ),
            *(ages if records else ()),
            *(() if forms else (_series("Age of datagrams received [s]", layout.DATAGRAM_AGE),)),
            _series("Frames of the radio, from the start", layout.PACKETS, named=True),
        ),
    ]


def _structure() -> list[Plot]:
    return [
        rrb.StateTimelineView(
            origin="/",
            contents=[f"{layout.PHASE}/**", f"{layout.ROLES}/**"],
            name="Phase and roles",
        ),
        rrb.Tabs(
            _series("Largest slot distance in each queue [m]", layout.QUEUE_RESIDUAL, named=True),
            _series("Tier (-1: in distress)", layout.TIER),
        ),
    ]


def _faults() -> list[Plot]:
    return [
        rrb.StateTimelineView(origin=layout.CONDITIONS, name="What is in force"),
        _series("Distance to own slot [m]", layout.SLOT_ERROR),
        _series("Velocity changed by the safety filter [m/s]", layout.SAFETY_FILTER),
    ]


def _flight_view(question: str, root: str = "", name: str = "") -> rrb.Spatial3DView:
    """Return a 3D view in the team's frame: it follows the team and keeps it in view.

    root: of the run's entities. name: of the view; left out, its question.
    """
    direction = EYE_DIRECTION / np.linalg.norm(EYE_DIRECTION)
    return rrb.Spatial3DView(
        origin=root + layout.TEAM,
        contents=f"{root}{layout.WORLD}/**",
        name=name or QUESTIONS[question],
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=EYE_DISTANCE * direction,
            look_target=(0, 0, 0),
            eye_up=(0, 0, 1),
        ),
        overrides=_overrides(question, root),
    )


def _overrides(question: str, root: str) -> dict[EntityPath | str, Override]:
    """Return what a tab's view changes: trails behind vehicles, and the layers that it hides."""
    changed: dict[EntityPath | str, Override] = {root + layout.AGENTS: _trail()}
    for layer in LAYERS:
        changed[root + layer] = rrb.EntityBehavior(visible=layer in SHOWN[question])
    return changed


def _trail() -> rrb.VisibleTimeRanges:
    """Return the time range that draws trails; recorded trails would cost far more."""
    boundary = rrb.TimeRangeBoundary
    trail = rrb.VisibleTimeRange(
        layout.SIM_TIME,
        start=boundary.cursor_relative(seconds=-TRAIL_S),
        end=boundary.cursor_relative(),
    )
    return rrb.VisibleTimeRanges([trail])


def _event_view(levels: Sequence[str], root: str = "") -> rrb.TextLogView:
    """Return the list of events: their text begins with the time, which the viewer would cut.

    levels: of the events that are listed.
    """
    times = [
        rrb.encodings.TimelineColumn(timeline, visible=False)
        for timeline in (layout.SIM_TIME, layout.TICK)
    ]
    columns = rrb.TextLogColumns(timeline_columns=times, text_log_columns=["LogLevel", "Body"])
    listed = rrb.TextLogRows(filter_by_log_level=list(levels))
    name = "Events" if levels == ALL_EVENTS else "Faults and changes of the radio"
    return rrb.TextLogView(origin=root + layout.EVENTS, name=name, columns=columns, rows=listed)


def _signal_plots(names: Sequence[str]) -> list[Plot]:
    """Return a tab for each number that controllers state of themselves, where there are any."""
    shown = [_series(f"Signal {name}", layout.signal_entity(name)) for name in names]
    return [rrb.Tabs(*shown)] if shown else []


def _series(name: str, origin: str, named: bool = False) -> rrb.TimeSeriesView:
    """Return curves; named: with a legend of their names."""
    return rrb.TimeSeriesView(origin=origin, name=name, plot_legend=rrb.PlotLegend(visible=named))
