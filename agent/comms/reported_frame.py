"""Frames that are known from beacons alone, without the path that they follow.

A member of an older mission flies by such a frame until the newer mission arrives. An agent without
a mission keeps pace with one that comes down the tiers.
"""

from typing import Final, NamedTuple

from agent.controller import HeardFrame
from agent.heard_beacon import HeardBeacon
from agent.messages import NO_MISSION, Drift, Pose
from agent.qstructure.target_frame import Frame
from agent.rejection import RejectedError

MAX_EXTRAPOLATION_S: Final = 5.0
"""A reported frame is extrapolated for this long; then it counts as at rest where it is."""


class ReportedFrame:
    """A frame known only from a beacon: its pose at a stamp, and its velocity then."""

    def __init__(self, pose: Pose, drift: Drift | None) -> None:
        self.pose = pose
        self.drift = drift
        self.rests = drift is None

    def at(self, time_s: float) -> Frame:
        """Return the frame at a time [s]."""
        pose, drift = self.pose, self.drift
        if drift is None:
            return Frame(pose[:3], pose.yaw)
        age_s = time_s - drift.stamp_s
        t = min(max(0.0, age_s), MAX_EXTRAPOLATION_S)
        origin = (pose.x + t * drift.x, pose.y + t * drift.y, pose.z + t * drift.z)
        yaw = pose.yaw + t * drift.yaw_rate
        if age_s > MAX_EXTRAPOLATION_S:
            return Frame(origin, yaw)
        return Frame(origin, yaw, (drift.x, drift.y, drift.z), drift.yaw_rate)


class _Report(NamedTuple):
    """A frame as one beacon reports it."""

    key: int  # of its mission
    stamp_s: float  # when the frame had the pose; of a frame at rest, when the beacon was sent [s]
    frame: ReportedFrame

    def holds_at(self, time_s: float) -> bool:
        """Whether it still counts at a time [s]."""
        return time_s - self.stamp_s <= MAX_EXTRAPOLATION_S


class FrameFromTiers:
    """The frame that came down the tiers to an agent without a mission.

    A neighbour is believed only while it has a tier: then a root that states its time leads to it.
    The highest key wins, then the newest stamp. A report counts for MAX_EXTRAPOLATION_S after its
    stamp, also of a frame at rest, so no key shuts out lower ones for longer.
    """

    def __init__(self) -> None:
        self._last: _Report | None = None

    def receive(self, beacon: HeardBeacon) -> None:
        """Take the frame of a beacon if it is newer. Raises RejectedError for one of the future."""
        if beacon.frame_key == NO_MISSION or not _has_tier(beacon):
            return
        check_stamp(beacon)
        stamp_s = beacon.drift.stamp_s if beacon.drift is not None else beacon.stamp_s
        report = _Report(beacon.frame_key, stamp_s, ReportedFrame(beacon.frame, beacon.drift))
        if report.holds_at(beacon.stamp_s) and self._is_newer(report, beacon.stamp_s):
            self._last = report

    def at(self, time_s: float) -> HeardFrame | None:
        """Return the frame at a time [s; Observation time]; None if none was heard of late."""
        last = self._last
        if last is None or not last.holds_at(time_s):
            return None
        return HeardFrame(last.key, last.frame.at(time_s))

    def _is_newer(self, report: _Report, time_s: float) -> bool:
        last = self._last
        return last is None or not last.holds_at(time_s) or report[:2] > last[:2]


def check_stamp(beacon: HeardBeacon) -> None:
    """Raise RejectedError for a frame with a stamp later than its beacon's."""
    if beacon.drift is not None and beacon.drift.stamp_s > beacon.stamp_s:
        raise RejectedError("future", "the frame's stamp is later than the beacon's")


def _has_tier(beacon: HeardBeacon) -> bool:
    """Whether the sender belongs to a tree: as its root, or with a parent (E15)."""
    branches = beacon.standing.branches if beacon.standing is not None else ()
    return any(branch is not None and branch.tier >= 0 for branch in branches)
