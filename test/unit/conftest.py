"""Which smach the unit tests run on: the one at $SMACH_UPSTREAM if that is set, else the one in src/."""
import os
import sys

SRC = os.path.abspath(os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir, os.pardir, 'src'))

sys.path.append(SRC)  # after a sourced workspace, whose smach_oracle has the generated messages
if os.environ.get('SMACH_UPSTREAM'):
    sys.path.insert(0, os.path.abspath(os.environ['SMACH_UPSTREAM']))
