#!/usr/bin/env python
"""With an IntrospectionServer, as the tutorial has it, and start callbacks."""

import rospy
from working import Step, Work, line, say, telling

import smach_ros


def main():
    rospy.init_node('viewed')
    inner = line(
        ('WORK', Work(stop=lambda: machine.request_preempt())),
        ('AFTER', Step('AFTER')),
        input_keys=['count'],
        output_keys=['count'],
    )
    machine = line(
        ('FIRST', Step('FIRST')), ('INNER', telling('INNER', inner)), ('LAST', Step('LAST'))
    )
    machine.userdata.count = 0
    machine.register_start_cb(lambda ud, initial, word: say(word, initial, ud.count), ['START'])
    telling('TOP', machine)
    viewer = smach_ros.IntrospectionServer('viewed_program', machine, '/SM_ROOT')
    viewer.start()
    # built: machine
    try:
        say('OUTCOME', machine.execute(), machine.userdata.count)
    finally:
        viewer.stop()


if __name__ == '__main__':
    main()
