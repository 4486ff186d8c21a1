"""A plugin for roswtf: what it says of the oracle's installation and of its running nodes."""

import os
import time
from typing import Any, Callable, Dict, List, Optional, Tuple

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from roswtf.rules import error_rule, warning_rule

from smach_oracle.packages import optional

LISTEN_S = 2.5  # a node tells its statuses once a second
STAND_INS = ('smach', 'smach_ros', 'smach_msgs')
OPTIONAL = {
    'rosbags': 'bags are recorded, but not counted or replayed',
    'cv2': 'no pictures on the console, and no marking of objects',
    'pybullet': 'no simulated PR2',
}
Rule = Tuple[Callable[[Any], List[str]], str]


def mixed_engine(_ctx: Any) -> List[str]:
    """Return which of smach, smach_ros and smach_msgs are ours, where the others are upstream's."""
    files = {name: getattr(optional(name), '__file__', None) or '' for name in STAND_INS}
    ours = [
        name
        for name, file in files.items()
        if os.path.exists(os.path.join(os.path.dirname(file), '.smach_oracle_stand_in'))
    ]
    return [] if len(ours) in (0, len(STAND_INS)) else ours


def lacking_packages(_ctx: Any) -> List[str]:
    """Return the optional packages that are missing, each with what does not work without it."""
    return [
        '{}: {}'.format(name, without)
        for name, without in OPTIONAL.items()
        if optional(name) is None
    ]


def told_by_nodes(level: bytes, statuses: Dict[str, DiagnosticStatus]) -> List[str]:
    """Return what the oracles of all nodes report on /diagnostics at a level."""
    return [
        '{}: {}{}'.format(
            each.name,
            each.message,
            ''.join(' ({}: {})'.format(value.key, value.value) for value in each.values),
        )
        for each in statuses.values()
        if each.hardware_id == 'smach_oracle' and each.level == level
    ]


def listen(seconds: Optional[float] = None) -> Dict[str, DiagnosticStatus]:
    """Return the latest status of each name that is heard in some seconds of the wall's time."""
    heard: Dict[str, DiagnosticStatus] = {}
    subscriber = rospy.Subscriber(
        '/diagnostics',
        DiagnosticArray,
        lambda message: heard.update((each.name, each) for each in message.status),
    )
    time.sleep(LISTEN_S if seconds is None else seconds)
    subscriber.unregister()
    return heard


STATIC_WARNINGS: List[Rule] = [
    (
        mixed_engine,
        'smach, smach_ros and smach_msgs are partly stand-ins of smach_oracle, partly '
        "upstream's. Install upstream's others, if that was not meant. Stand-ins:",
    ),
    (lacking_packages, 'optional packages of smach_oracle are missing:'),
]


def roswtf_plugin_static(ctx: Any) -> None:
    """The checks that need no master."""
    for rule in STATIC_WARNINGS:
        warning_rule(rule, rule[0](ctx), ctx)


def roswtf_plugin_online(ctx: Any) -> None:
    """The checks of running nodes."""
    statuses = listen()
    for level, report, text in (
        (DiagnosticStatus.WARN, warning_rule, 'oracles need a person:'),
        (DiagnosticStatus.ERROR, error_rule, 'oracles lose data:'),
    ):
        found = told_by_nodes(level, statuses)
        report((told_by_nodes, text), found, ctx)
