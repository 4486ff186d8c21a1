"""Commands to hold a machine: stop it, pause it, let it go on. Pure."""

from typing import Dict

from .checks import CommandSpec, flag, seen, text, texts

MOST_ROBOTS = 200
MACHINE = {'robot': text(400, 1), 'path': text(1000)}  # path '': every machine of the robot
# whoever sees a robot may stop it, and have it wait
ONE_STOPPED = ('stop_machine', 'pause_machine')
# several robots at once, [] for all that can be held. By the name: what each of them is sent
MANY_STOPPED = {'stop_robots': 'stop_machine', 'pause_robots': 'pause_machine'}
MACHINE_STOPS = (*ONE_STOPPED, *MANY_STOPPED)
# what lets a machine go on
MACHINE_STARTS = ('resume_machine', 'step_machine', 'confirm_state')

HOLDING_COMMANDS: Dict[str, CommandSpec] = {
    **{name: CommandSpec('viewer', MACHINE) for name in ONE_STOPPED},
    **{name: CommandSpec('viewer', {'robots': texts(MOST_ROBOTS, 400)}) for name in MANY_STOPPED},
    **{name: CommandSpec('operator', dict(MACHINE, seen=seen)) for name in MACHINE_STARTS},
    'set_breakpoint': CommandSpec('operator', dict(MACHINE, pattern=text(400, 1), remove=flag)),
}
