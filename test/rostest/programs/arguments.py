#!/usr/bin/env python
"""Arguments and options of its own, ROS remappings, private parameters, `rospy.myargv`."""

import argparse
import sys

import rospy
from working import Step, Work, line, say, telling


def main(args):
    parser = argparse.ArgumentParser()
    parser.add_argument('ending')
    parser.add_argument('--config')
    parser.add_argument('--record', action='store_true')
    given = parser.parse_args(args)
    rospy.init_node('arguments', anonymous=False, disable_signals=False)
    say(
        'GIVEN',
        given.config,
        given.record,
        rospy.get_param('~speed', 1),
        rospy.resolve_name('arm').rpartition('/')[2],
    )
    work = Work()
    machine = telling('TOP', line(('FIRST', Step('FIRST')), ('WORK', work), ('LAST', Step('LAST'))))
    work.stop = machine.request_preempt
    machine.userdata.count = rospy.get_param('~speed', 1)
    # built: machine
    say('OUTCOME', machine.execute(), machine.userdata.count)


if __name__ == '__main__':
    main(rospy.myargv(sys.argv)[1:])
