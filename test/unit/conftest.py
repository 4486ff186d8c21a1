"""Which smach the unit tests run on: the one at $SMACH_UPSTREAM if that is set, else the one in src/; `waiting`."""
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
SRC = os.path.abspath(os.path.join(HERE, os.pardir, os.pardir, 'src'))

sys.path.append(SRC)  # after a sourced workspace, whose smach_oracle has the generated messages
sys.path.append(os.path.join(HERE, os.pardir, 'rostest'))  # waiting
if os.environ.get('SMACH_UPSTREAM'):
    sys.path.insert(0, os.path.abspath(os.environ['SMACH_UPSTREAM']))
