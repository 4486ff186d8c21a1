"""Commands to hold a machine: stop it, pause it, let it go on. Pure."""

from typing import Dict

from .checks import CommandSpec, flag, seen, text

MACHINE = {'robot': text(400, 1), 'path': text(1000)}  # path '': every machine of the robot
# whoever sees a robot may stop it, and have it wait
MACHINE_STOPS = ('stop_machine', 'pause_machine')
# what lets a machine go on
MACHINE_STARTS = ('resume_machine', 'step_machine', 'confirm_state')

HOLDING_COMMANDS: Dict[str, CommandSpec] = {
    **{name: CommandSpec('viewer', MACHINE) for name in MACHINE_STOPS},
    **{name: CommandSpec('operator', dict(MACHINE, seen=seen)) for name in MACHINE_STARTS},
    'set_breakpoint': CommandSpec('operator', dict(MACHINE, pattern=text(400, 1), remove=flag)),
}
