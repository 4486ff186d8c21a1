"""A test kit for users: faults in their machines, an expert by script, assertions, soaks.

    from smach_oracle.testing import Bench, expert, fail, goto

    def test_a_failed_grasp_is_tried_again():
        with Bench(build_machine(), [fail('PICK', visit=1, outcome='aborted')]) as bench:
            bench.run().assert_recovered('PICK').assert_not_asked()

Without ROS, unless it is asked for. doc/testing.md has the whole of it.
"""

from .bench import Bench
from .errors import FaultError, ScriptError, TrialLimitError
from .faults import Fault, FaultKind, crash, fail, hang, overrun, stub
from .injection import faults
from .observed_trial import ObservedTrial
from .script import AnswerScript, expert, give_up, goto, no_answer, supersede, use_interface
from .script_run import ScriptRun, run_script
from .soak import soak, soak_trial
from .soak_report import SoakReport, SoakRow, SoakTrial
from .stopped_clock import StoppedClock

__all__ = [
    'AnswerScript',
    'Bench',
    'Fault',
    'FaultError',
    'FaultKind',
    'ObservedTrial',
    'ScriptError',
    'ScriptRun',
    'SoakReport',
    'SoakRow',
    'SoakTrial',
    'StoppedClock',
    'TrialLimitError',
    'crash',
    'expert',
    'fail',
    'faults',
    'give_up',
    'goto',
    'hang',
    'no_answer',
    'overrun',
    'run_script',
    'soak',
    'soak_trial',
    'stub',
    'supersede',
    'use_interface',
]
