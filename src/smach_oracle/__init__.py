"""Recovery from failures for SMACH state machines, with a human expert as the last resort.

`OracleContainer` is the ROS-attached one where rospy is installed, else the bare one. It is looked
up on first use, so that `smach_oracle.analysis` needs neither ROS nor SMACH.

Errors that you may catch, in addition to those of the executive in `smach_oracle.oracle.errors`::

    OracleError
    +-- AnswerError
    |     +-- QuestionRefusedError: a server does not take a question (ros.expert.open_questions)
    +-- BagError: a bag cannot be used (analysis.bag_events)
    |     +-- BagReadError: of several bags, this one cannot be used (analysis.bag_worker)
    +-- BagFormatError: the bytes are no bag (bag_format)
    +-- ClusterError: a Dask cluster cannot be used (cluster)
    |     +-- WorkersLost: those that had the work are gone (cluster)
    +-- FaultError (also a ValueError): a fault does not fit the machine (testing.errors)
    +-- InterfaceGoalError (also a ValueError): a goal cannot end so (interfaces.interface_goal)
    +-- ServerGoneError: a server is not reached or does not answer (ros.service_calls)
    +-- UserdataCodecError (also a ValueError): an item is malformed (ros.userdata_codec)
    AssertionError
    +-- ScriptError: a question does not go with the expert's script (testing.errors)
    +-- TrialLimitError: a trial did not end in time (testing.errors)
    Exception
    +-- StoreError: a store cannot be opened, read or written (store.errors)
          +-- StoreDamaged: its content cannot be read (store.errors)
          +-- Held: another process holds the machine (store.holding)
"""

from typing import Any

from .release import VERSION

__all__ = ['OracleContainer']
__version__ = VERSION


def __getattr__(name: str) -> Any:
    if name != 'OracleContainer':
        raise AttributeError('module {!r} has no attribute {!r}'.format(__name__, name))
    try:
        import rospy  # noqa: F401
    except ImportError:
        from smach_oracle.oracle import OracleContainer
    else:
        from smach_oracle.ros.container import OracleContainer
    globals()[name] = OracleContainer
    return OracleContainer
