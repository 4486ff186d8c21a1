"""The values of ROS in a store: messages and arrays in userdata, and the goals that run."""

from smach_oracle.oracle.records.running_goals import GOALS

from .goal_ending import end_goals
from .goal_notes import note_goals
from .ros_codecs import offer_ros_codecs


def prepare_store(is_node: bool) -> None:
    """Let stores of this process keep what belongs to ROS."""
    offer_ros_codecs()
    if is_node:
        note_goals()
        GOALS.end_goals = end_goals
