"""Borders of the simulated world: its services, on one world that stays as it is."""

import dataclasses
import functools
from types import SimpleNamespace
from typing import Any, Callable
from unittest import mock

import rospy
from hypothesis import strategies as st

from smach_oracle.simulation.node import main, reveal
from smach_oracle.simulation.node.lab import Lab
from smach_oracle.simulation.node.loop import PERIOD_S
from smach_oracle.simulation.node.settings import WorldSettings
from smach_oracle.simulation.scenes.lab import LabRun
from smach_oracle.simulation.scenes.tasks import TASKS
from smach_oracle.srv import (
    ChargeTimeRequest,
    PassTimeRequest,
    RecogniseRequest,
    ResetWorldRequest,
    RevealRequest,
    SnapshotRequest,
)

from .border import TAKEN, Border, refused
from .fake_ros import as_bytes, fake_ros
from .values import message, words

LONGEST_S = 36000.0  # that may pass at once, as srv/PassTime.srv has it
SETTINGS = WorldSettings(camera_binning=2, reveal=True)
_seeds = st.one_of(
    st.integers(0, 9), st.sampled_from((2**31, 2**32, 2**53, 2**64 - 1)), st.integers(0, 2**64 - 1)
)
_bodies = st.lists(words('table', 'robot', 'floor', 'thing', 'fridge'), max_size=3)


@functools.lru_cache(maxsize=None)
def _world() -> Any:
    """A world's node without its thread, its services, and the stamp of an image.

    What a reset draws is drawn; the physics behind a reset, and time that passes, are faked.
    """
    with fake_ros() as offered, mock.patch.object(rospy, 'set_param'):
        node = main.WorldNode(SETTINGS)
        node._loop.call = lambda work: work()
        image = offered.call('world/snapshot', SnapshotRequest(camera=True))
        assert image.ok
        names = list(node._world.body_names)
    scene = node._world.scene
    node._world.reset = lambda drawn: setattr(node._world, '_scene', drawn)
    node._loop.pass_by = _pass_by
    shown = functools.lru_cache(maxsize=1)(lambda: reveal_view(node._world))
    return SimpleNamespace(
        node=node,
        offered=offered,
        stamp=image.stamp,
        scene=scene,
        names=names,
        view=lambda *_: shown(),
    )


reveal_view = (
    lambda view: lambda world: view(world, reveal.camera_pose(world), reveal.size_of(world))
)(reveal.RenderedView)


def _pass_by(world: Any, seconds: float) -> None:
    """In place of the loop's: time does not pass, but it could."""
    assert 0 <= round(seconds / PERIOD_S) <= LONGEST_S / PERIOD_S


def _service(name: str, task: str = TASKS[0], with_lab: bool = False) -> Callable[[Any], str]:
    def take(request: Any) -> str:
        made = _world()
        node = made.node
        node._settings = dataclasses.replace(SETTINGS, task=task)
        node._lab = Lab(LabRun(3, 0.5), None, node._settings) if with_lab else None
        kept = node._recognition._views.copy()
        still = mock.patch.object(node._world, 'step')
        with fake_ros(), mock.patch.object(reveal, 'RenderedView', made.view), still:
            try:
                reply = as_bytes(made.offered.services['world/' + name](request))
            except rospy.ServiceException as err:
                return refused(err)
            finally:
                node._world._scene = made.scene
                node._recognition._views = kept
        return TAKEN if getattr(reply, 'ok', True) else refused(reply.message)

    return take


def _stamps() -> Any:
    return st.deferred(lambda: st.just(_world().stamp))


def _things() -> Any:
    return st.deferred(lambda: st.lists(st.sampled_from(_world().names), max_size=2))


BORDERS = [
    *[
        Border(
            'service world/reset, ' + task,
            message(ResetWorldRequest, {'seed': _seeds}),
            _service('reset', task),
            (TAKEN,),
        )
        for task in TASKS
    ],
    Border(
        'service world/reset, in a lab',
        message(ResetWorldRequest, {'seed': _seeds}),
        _service('reset', with_lab=True),
    ),
    Border('service world/snapshot', message(SnapshotRequest), _service('snapshot'), (TAKEN,)),
    Border(
        'service world/pass_time',
        message(PassTimeRequest, {'seconds': st.sampled_from((0.0, 0.5, 36000.0, 36000.1))}),
        _service('pass_time'),
    ),
    Border(
        'service world/charge_time', message(ChargeTimeRequest), _service('charge_time'), (TAKEN,)
    ),
    Border(
        'service world/recognise',
        message(RecogniseRequest, {'stamp': _stamps(), 'names': _bodies}),
        _service('recognise'),
    ),
    Border(
        'service world/reveal',
        message(RevealRequest, {'names': st.one_of(_bodies, _things())}),
        _service('reveal'),
    ),
]
