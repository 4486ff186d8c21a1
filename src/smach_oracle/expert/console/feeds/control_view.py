"""The state of a robot's machines, as plain data for the page. Pure."""

from typing import List

from smach_oracle.msg import ControlStatus, MachineControl

from ..shapes.robots import HeldMachineView

MOST_MACHINES = 20
MOST_ACTIVE = 50  # states of a machine that run or wait
MOST_BREAKPOINTS = 100


def control_view(message: ControlStatus) -> List[HeldMachineView]:
    """A robot's top-level machines: what runs, what waits and why, which breakpoints are set."""
    return [_machine(each) for each in message.machines[:MOST_MACHINES]]


def _machine(machine: MachineControl) -> HeldMachineView:
    return {
        'path': machine.path,
        'running': machine.running,
        'paused': machine.paused,
        'by': machine.paused_by,
        'active': [
            {
                'path': each.path,
                'state': each.state,
                'held': each.held_by,
                'confirm': each.waits_for_confirmation,
            }
            for each in machine.active[:MOST_ACTIVE]
        ],
        'breakpoints': list(machine.breakpoints[:MOST_BREAKPOINTS]),
    }
