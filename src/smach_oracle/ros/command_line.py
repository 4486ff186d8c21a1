"""The command line of a node that is set by ROS parameters alone, and a name that is free."""

import argparse
import http.client
import itertools
import sys
import xmlrpc.client
from typing import Any, Iterator

import rosgraph
import rospy

from smach_common.node_end import end_quietly
from smach_common.node_probe import TimedTransport

ANSWER_S = 2.0  # that a node of the same name has to show that it runs
OWN_NAME = '__name:='


def parameters_only(description: str) -> None:
    """Answer --help, and refuse any other argument that is not a ROS remapping.

    Both work without a master. The node will end quietly.
    """
    argparse.ArgumentParser(description=description).parse_args(rospy.myargv()[1:])
    end_quietly()


def init_beside_others(name: str) -> None:
    """Make this process a node, and let a running node of the same name live.

    ROS would end the other one. This node takes the name with a number then, `expert_console_2`,
    with the parameters that were set for the name it gave up.
    """
    end_quietly()
    wanted = next((arg[len(OWN_NAME) :] for arg in sys.argv if arg.startswith(OWN_NAME)), name)
    free = _free_name(wanted)
    if free == wanted:
        rospy.init_node(name)
        return
    given = [arg for arg in sys.argv if not arg.startswith(OWN_NAME)]
    _copy_parameters(wanted, free)
    rospy.init_node(free, argv=given)
    rospy.logwarn(
        'A node %s already runs on this master. This one is %s.', _full(wanted), rospy.get_name()
    )


def _full(name: str) -> str:
    joined: str = rosgraph.names.ns_join(rosgraph.names.get_ros_namespace(), name)
    return joined


def _names(name: str) -> Iterator[str]:
    yield name
    for number in itertools.count(2):
        yield '{}_{}'.format(name, number)


def _free_name(name: str) -> str:
    """The first of NAME, NAME_2, NAME_3 that no running node has."""
    master = rosgraph.Master('/' + name)
    try:
        return next(each for each in _names(name) if not _runs(master, _full(each)))
    except (OSError, rosgraph.MasterException):
        return name  # no master yet. Rospy waits for it


def _runs(master: Any, name: str) -> bool:
    try:
        uri = master.lookupNode(name)
    except rosgraph.MasterError:
        return False
    try:
        xmlrpc.client.ServerProxy(uri, transport=TimedTransport(ANSWER_S)).getPid(name)
    except (OSError, http.client.HTTPException, xmlrpc.client.Error):
        return False  # it was killed, and the master does not know it yet
    return True


def _copy_parameters(old: str, new: str) -> None:
    master = rosgraph.Master('/' + new)
    # the whole namespace: a parameter may have keys with slashes in them
    if master.hasParam(_full(old)):
        master.setParam(_full(new), master.getParam(_full(old)))
