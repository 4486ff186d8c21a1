"""Scripts for oracle_run, to be run in a process of their own."""

RUNNER = 'from smach_oracle.ros.oracle_run.script_runner import main; main()'
# states that say when they run, and a chain of them
MACHINES = """
class Runs(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted', 'preempted'])
    def execute(self, userdata):
        print('STATE RUNS', flush=True)
        return 'succeeded'
def machine(*labels):
    sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
    with sm:
        for label, after in zip(labels, labels[1:] + ('succeeded',)):
            smach.StateMachine.add(label, Runs(), {'succeeded': after})
    return sm
"""
