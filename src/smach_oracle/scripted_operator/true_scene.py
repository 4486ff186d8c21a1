"""Bodies as they truly are, in the robot's base frame. Plain data."""
from typing import Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.transforms import yaw_of


class TrueBody(NamedTuple):
    """A thing or a piece of furniture."""

    name: str
    pose: np.ndarray  # 4x4, base_footprint (as it truly stands) from the thing's centre
    size: Tuple[float, float, float]  # m, along its axes
    movable: bool
    held: str  # 'left', 'right' or ''
    # px: x, y, width, height in the camera's image; width 0: unseen
    region: Tuple[int, int, int, int] = (0, 0, 0, 0)
    visible: float = 0.0  # share of its outline that nothing hides
    angle: float = 0.0  # rad that its door is open

    @property
    def centre(self) -> np.ndarray:
        """(3,) m."""
        return self.pose[:3, 3]

    @property
    def upright(self) -> bool:
        """Its z axis points up, within 20 degrees."""
        return bool(self.pose[2, 2] > np.cos(np.radians(20)))

    @property
    def box(self) -> UprightBox:
        """As a box that stands upright."""
        return UprightBox(self.centre, np.array(self.size), yaw_of(self.pose))

    @property
    def bottom(self) -> float:
        """m above the floor."""
        return float(self.pose[2, 3] - np.abs(self.pose[2, :3]) @ np.array(self.size) / 2)

    @property
    def top(self) -> float:
        """m above the floor."""
        return float(self.pose[2, 3] + np.abs(self.pose[2, :3]) @ np.array(self.size) / 2)


class TrueScene(NamedTuple):
    """All bodies, at one moment."""

    bodies: Dict[str, TrueBody]
    seed: int  # of the trial
    goal_body: str  # '' for any of the movable ones

    def movable(self) -> List[TrueBody]:
        """The things that a hand could take."""
        return [body for body in self.bodies.values() if body.movable]

    def held_by(self, arm: str) -> Optional[TrueBody]:
        """The thing that an arm holds."""
        return next((body for body in self.movable() if body.held == arm), None)

    def nearest(self, point: np.ndarray, within: float) -> Optional[TrueBody]:
        """The movable thing nearest to a point (3,) m, in the plane, within that many m."""
        beside = [(float(np.hypot(*(body.centre - point)[:2])), body.name)
                  for body in self.movable()]
        distance, name = min(beside, default=(np.inf, ''))
        return self.bodies[name] if distance <= within else None

    def support_below(self, body: TrueBody) -> Optional[TrueBody]:
        """The piece of furniture that a thing stands on, or stands nearest above."""
        def carries(other: TrueBody) -> bool:
            reach = np.abs(other.pose[:2, :3]) @ np.array(other.size) / 2
            above = bool((np.abs(body.centre - other.centre)[:2] < reach).all())
            return not other.movable and above and other.top < body.centre[2]
        below = [other for other in self.bodies.values() if carries(other)]
        return max(below, key=lambda other: other.top) if below else None
