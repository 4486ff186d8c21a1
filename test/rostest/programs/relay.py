#!/usr/bin/env python
# what catkin puts into devel/lib, for rosrun and roslaunch to find
import os.path
import sys

python_script = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'nested_functions.py')
sys.path.insert(0, os.path.dirname(python_script))
with open(python_script) as fh:
    context = {
        '__builtins__': __builtins__,
        '__doc__': None,
        '__file__': python_script,
        '__name__': __name__,
        '__package__': None,
    }
    exec(compile(fh.read(), python_script, 'exec'), context)
