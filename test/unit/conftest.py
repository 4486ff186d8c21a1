"""Which smach the unit tests run on, that of $SMACH_UPSTREAM or that of src/; and the folders of
shared helpers.
"""
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
SRC = os.path.abspath(os.path.join(HERE, os.pardir, os.pardir, 'src'))

sys.path.append(SRC)  # after a sourced workspace, whose smach_oracle has the generated messages
sys.path.append(os.path.join(HERE, os.pardir, 'rostest'))  # waiting, expert_fixtures
# worlds, cameras and trials that tests of several rooms use
sys.path.append(os.path.join(HERE, 'support'))
if os.environ.get('SMACH_UPSTREAM'):
    sys.path.insert(0, os.path.abspath(os.environ['SMACH_UPSTREAM']))
