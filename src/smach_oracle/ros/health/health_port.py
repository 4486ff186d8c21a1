"""The port by which the executive learns of topics and diagnostics whether the robot is well."""

import threading
import time
from functools import partial
from typing import Any, List, NamedTuple, Optional, Sequence

import rospy

from smach_oracle.oracle.settings.health import HealthCondition, HealthKind

from ..main_thread import outside_main_thread
from .field_rules import why_unwell_by_message, why_unwell_by_status
from .health_topics import HealthTopics, Latest, UnreadableMessage, decoded

SILENT_AFTER_S = 5.0  # of listening: then a warning names what was never heard of


class _Heard(NamedTuple):
    """A condition, and what was heard of it."""

    condition: HealthCondition
    latest: Latest


class TopicHealth:
    """Conditions of topics and diagnostics, of which all must hold.

    If a source never published, its condition holds, unless it has a `max_age_s`. One warning
    names the source.
    """

    def __init__(self, conditions: Sequence[HealthCondition], topics: HealthTopics) -> None:
        self._heard: List[_Heard] = [
            _Heard(
                each,
                topics.message(each.source)
                if each.kind is HealthKind.TOPIC
                else topics.status(each.source),
            )
            for each in conditions
        ]
        self._topics = topics
        new = {_source_of(each) for each in conditions} - topics.watched
        if new:
            topics.watched.update(new)
            timer = threading.Timer(SILENT_AFTER_S, self._warn_of_silence)
            timer.daemon = True
            timer.start()

    def why_unwell(self, since_s: Optional[float] = None) -> str:
        """Return what is wrong, or was since that monotonic time, '' where all is well.

        A topic may change twice between two looks, so every message since then is read.
        """
        self._warn_of_silence()
        if since_s is None:
            since_s = time.monotonic()
        found = [(heard.condition.name, self._why(heard, since_s)) for heard in self._heard]
        return '; '.join('{}: {}'.format(name, why) for name, why in found if why)

    def _why(self, heard: _Heard, since_s: float) -> str:
        condition, age_s = heard.condition, heard.latest.age_s()
        if age_s is None:
            return 'not heard of yet' if condition.max_age_s is not None else ''
        messages = heard.latest.since(since_s)
        longest_s = max([age_s] + [each.gap_s for each in messages if each.at_s > since_s])
        if condition.max_age_s is not None and longest_s > condition.max_age_s:
            return 'not heard of for {:.0f} s'.format(longest_s)
        return next(filter(None, (_why_by(condition, each.what) for each in messages)), '')

    def _warn_of_silence(self) -> None:
        for condition, latest in self._heard:
            source, warned = _source_of(condition), self._topics.warned
            if latest.age_s() is None and source not in warned and not rospy.is_shutdown():
                warned.add(source)
                rospy.logwarn(
                    'healthy: %s has not published yet, so its condition %s',
                    source,
                    'holds' if condition.max_age_s is None else 'does not hold',
                )


def _why_by(condition: HealthCondition, what: Any) -> str:
    """What one message, or one status, says is wrong, '' where it says well."""
    if condition.kind is HealthKind.DIAGNOSTICS:
        return why_unwell_by_status(condition, what)
    try:
        return why_unwell_by_message(condition, decoded(what))
    except UnreadableMessage as err:
        return 'its messages cannot be read ({})'.format(err)


def _source_of(condition: HealthCondition) -> str:
    return '{} {}'.format(condition.kind.value, condition.source)


def listen_to_health(
    topics: HealthTopics, conditions: Sequence[HealthCondition]
) -> Optional[TopicHealth]:
    """Make a port for conditions, or None where the node shuts down."""
    try:
        return outside_main_thread(partial(TopicHealth, conditions, topics))
    except rospy.ROSInterruptException as err:
        rospy.logwarn('healthy: not listened to: %s', err)
        return None
