"""The printed output of an interface, as plain data for the page. Pure."""

from typing import Dict, Optional

from smach_oracle.msg import InterfaceOutput

from ..shapes.questions import InterfaceOutputView, InterfaceStatus

_STATUS: Dict[int, InterfaceStatus] = {
    InterfaceOutput.STARTING: 'starting',
    InterfaceOutput.RUNNING: 'running',
    InterfaceOutput.FAILED: 'failed',
    InterfaceOutput.STOPPED: 'stopped',
}
SHOWN_LINES = 60
LONGEST_TEXT = 500


def interface_output_view(message: Optional[InterfaceOutput]) -> Optional[InterfaceOutputView]:
    """Status, text and the last lines, or None where nothing was started."""
    if message is None:
        return None
    return {
        'status': _STATUS.get(message.status, ''),
        'text': message.text[:LONGEST_TEXT],
        'lines': list(message.lines[-SHOWN_LINES:]),
    }
