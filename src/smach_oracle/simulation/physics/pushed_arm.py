"""An arm of the robot that a person pushes: by forces at its elbow and its hand.

Against motors that hold it, the arm gives way and springs back as soon as the person lets go. So
somebody who wants an arm out of the way stops its controllers first, as people do on a PR2
(`pr2_mannequin_mode`): the balanced arm then follows the hand, and stays where it is let go. The
controllers that start again hold it there.
"""

from typing import Dict, List

import numpy as np

from smach_oracle.geometry.chain import JointChain
from smach_oracle.geometry.transforms import apply
from smach_oracle.pr2.model.pr2_model import pr2_urdf
from smach_oracle.pr2.robot import ARM_JOINTS, BASE_FRAME

from .easing import eased
from .pr2_body import STEP, Pr2Body, arm_of

# link, point in its frame (m), and N with which a person pushes there at most: a hand at the elbow,
# and one about the gripper, which can also turn it
GRIPS = (
    ('elbow_flex_link', (0.0, 0.0, 0.0), 100.0),
    ('gripper_palm_link', (0.05, 0.05, 0.0), 50.0),
    ('gripper_palm_link', (0.05, -0.05, 0.0), 50.0),
)
PULL = 800.0  # N for each m that a point is behind where the person wants it
DRAG = 30.0  # N for each m/s: a person does not fling it
SETTLING_S = 0.5  # at the end of the way, before the person lets go


class PushedArm:
    """A push that is under way."""

    def __init__(
        self, robot: Pr2Body, joints: Dict[str, float], seconds: float, motors: bool
    ) -> None:
        """Begin to push.

        :param joints: rad by name, of one arm. The others of it stay.
        :param seconds: that the way takes. The person holds the arm for SETTLING_S more.
        :param motors: whether the arm's controllers run, and hold against it.
        """
        self._robot, self._motors = robot, motors
        self._arm = arm_of(next(iter(joints)))
        torso = {'torso_lift_joint': robot.position('torso_lift_joint')}
        urdf = pr2_urdf().read_text(encoding='utf-8')
        self._grips = [(self._arm[0] + '_' + link, point, most) for link, point, most in GRIPS]
        self._chains = [
            JointChain.from_urdf(urdf, BASE_FRAME, link, torso) for link, _, _ in self._grips
        ]
        self._start = np.array([robot.position(name) for name in ARM_JOINTS[self._arm]])
        self._way = (
            np.array(
                [joints.get(name, start) for name, start in zip(ARM_JOINTS[self._arm], self._start)]
            )
            - self._start
        )
        self._steps = max(1, round(seconds / STEP))
        self._left = self._steps + round(SETTLING_S / STEP)
        self._before: List[np.ndarray] = []
        if not motors:
            robot.go_limp(self._arm)

    @property
    def over(self) -> bool:
        """Whether the person has let go."""
        return self._left <= 0

    def push(self) -> None:
        """Push for the coming step of physics. Let go after the last one."""
        share = eased(min(1.0, 1.0 - (self._left - round(SETTLING_S / STEP)) / self._steps))
        wanted = self._points(share)
        here = [
            apply(self._robot.link_pose(link), np.array(point)) for link, point, _ in self._grips
        ]
        for (link, _, most), goal, point, before in zip(
            self._grips, wanted, here, self._before or here
        ):
            force = PULL * (goal - point) - DRAG * (point - before) / STEP
            force *= min(1.0, most / max(float(np.linalg.norm(force)), 1e-9))
            self._robot.push(link, point, force)
        self._before = here
        self._left -= 1
        if self.over and not self._motors:
            self._robot.hold(self._arm)

    def _points(self, share: float) -> List[np.ndarray]:
        """Return where the person wants the points now, in the world."""
        q, base = self._start + share * self._way, self._robot.base()
        return [
            apply(base @ chain.forward(q[: len(chain.names)]), np.array(point))
            for chain, (_, point, _) in zip(self._chains, self._grips)
        ]
