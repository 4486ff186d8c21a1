"""Decides how much of the last seconds goes into the bag of a trial."""

from typing import Callable, List, Optional, Sequence, Tuple, TypeVar

from smach_oracle.msg import FailureReplay

from .failure_ring import Before, KeptImage, KeptJoints, fill
from .replay_settings import MEGABYTE

Kept = TypeVar('Kept', KeptImage, KeptJoints)


class BagQuota:
    """The bytes that one trial may still put into its bag, and what it has put there.

    Not thread-safe: the events of a trial come one after another.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most = self.left = most_bytes
        self._last = 0  # number of what was kept last when the bag got something

    def message(
        self, before: Before, empty: Callable[[], FailureReplay]
    ) -> Optional[FailureReplay]:
        """Return the message for a failure, None where there is nothing new to say.

        The newest images come first, then the newest joint states, as far as the quota goes. The
        message counts what it leaves out.

        :param empty: makes a message with nothing in it.
        """
        new_images = [kept for kept in before.images if kept.number > self._last]
        new_joints = [kept for kept in before.joints if kept.number > self._last]
        if not new_images and not new_joints:
            return None
        self._last = max(_last_number(new_images), _last_number(new_joints))
        images, of_images = _newest(new_images, self.left)
        joints, of_joints = _newest(new_joints, self.left - of_images)
        self.left -= of_images + of_joints
        message = empty()
        fill(message, images, joints)
        message.images_left_out = len(new_images) - len(images)
        message.joints_left_out = len(new_joints) - len(joints)
        if message.images_left_out or message.joints_left_out:
            message.text = (
                '{} images and {} joint states are left out: ~replay_bag_mb allows {:g} MB for the '
                'bag of a trial'.format(
                    message.images_left_out, message.joints_left_out, self._most / MEGABYTE
                )
            )
        return message


def _last_number(kept: Sequence[Kept]) -> int:
    return kept[-1].number if kept else 0


def _newest(kept: Sequence[Kept], most_bytes: int) -> Tuple[List[Kept], int]:
    """Return the newest that fit into so many bytes, oldest first, and their bytes."""
    first, taken = len(kept), 0
    while first and taken + kept[first - 1].wire <= most_bytes:
        first -= 1
        taken += kept[first].wire
    return list(kept[first:]), taken
