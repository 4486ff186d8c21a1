"""The commands of a page with their arguments, and what the replies hold.

The checks of single arguments are in commands/. A test compares the names of both.
"""

from typing import List, Literal, Tuple, TypedDict

from .basics import DriveFrame, Vector

AnswerKind = str
ImageFrame = str
GripperWish = str
Point = Tuple[float, float]  # px: right, down
LookedAt = Literal['trials', 'people', '']  # which lists are looked at


class HelloView(TypedDict):
    """Who uses the page."""

    xsrf: str
    expert: str


class OfTrialView(TypedDict):
    """A trial by its id."""

    trial: str


class LookView(TypedDict):
    """The place that a person looks at."""

    at: LookedAt


class OfQuestionView(TypedDict):
    """A question by its key."""

    question: str


class _Seen(TypedDict, total=False):
    seen: float  # the newest beat that the page has had


class OutputView(TypedDict):
    """A value for the userdata."""

    key: str
    value: object
    type: str


class AnswerView(TypedDict):
    """An answer to a question."""

    kind: AnswerKind
    name: str
    container: str  # path of another one than that of the failed state; '': that one
    outputs: List[OutputView]
    why: str


class AnswerCommandView(OfQuestionView, AnswerView, _Seen):
    """An answer, and its question."""


class StrokeView(TypedDict):
    """A line on an image, px."""

    foreground: bool
    width: float
    points: List[Point]


class MarkView(OfQuestionView):
    """What is drawn on an image."""

    stamp: str
    region: List[Point]
    strokes: List[StrokeView]


class UseFrameView(OfQuestionView):
    """The image that is to be drawn on."""

    frame: ImageFrame


class WithReasonView(OfQuestionView):
    """A question, and why something is done about it."""

    why: str


class _Outputs(TypedDict, total=False):
    outputs: List[OutputView]


class HandOverView(WithReasonView, _Outputs, _Seen):
    """The end of the work of an interface."""

    outcome: str


class OfMachineView(TypedDict):
    """A machine of a robot, by the path of a container of it; '': all of the robot's."""

    robot: str
    path: str


class StartView(OfMachineView, _Seen):
    """A machine that goes on."""


class BreakpointView(OfMachineView):
    """States before which a machine pauses."""

    pattern: str
    remove: bool


class ManyRobotsView(TypedDict):
    """Several robots; none: all that can be held."""

    robots: List[str]


class OfDownView(TypedDict):
    """A machine that is down, by the key and the moment of its row."""

    down: str
    moment: int


class GoToStoredView(OfDownView):
    """The state at which it goes on."""

    label: str


class EditStoredView(OfDownView):
    """A value for its userdata."""

    container: str
    key: str
    json: str


class WriteNoteView(TypedDict):
    """A note for the next shift."""

    text: str


class DropNoteView(TypedDict):
    """A note by its id."""

    note: str


class DriveWishView(TypedDict):
    """What a person holds. Axes are -1 to 1."""

    held: bool
    linear: Vector  # forward, left, up
    angular: Vector  # about these
    gripper: GripperWish


class DriveView(OfQuestionView, DriveWishView):
    """A step of a hand."""

    frame: DriveFrame
    arm: str
    sent: float  # ms


# Commands by their names, with their arguments.
CommandsView = TypedDict(
    'CommandsView',
    {
        'hello': HelloView,
        'watch': OfTrialView,
        'look': LookView,
        'claim': OfQuestionView,
        'take_over': OfQuestionView,
        'release': OfQuestionView,
        'pressed': OfQuestionView,  # its holder is at work
        'view': OfQuestionView,  # '': at none
        'answer': AnswerCommandView,
        'mark': MarkView,
        'use_frame': UseFrameView,
        'hand_over': HandOverView,
        'give_up_interface': WithReasonView,
        'take_wheel': OfQuestionView,
        'leave_wheel': OfQuestionView,
        'stop_hand': OfQuestionView,
        'stop_machine': OfMachineView,
        'pause_machine': OfMachineView,
        'stop_robots': ManyRobotsView,
        'pause_robots': ManyRobotsView,
        'resume_machine': StartView,
        'step_machine': StartView,
        'confirm_state': StartView,
        'set_breakpoint': BreakpointView,
        'goto_stored': GoToStoredView,
        'edit_stored': EditStoredView,
        'drop_stored': OfDownView,
        'write_note': WriteNoteView,
        'drop_note': DropNoteView,
        'drive': DriveView,
    },
)


class HelloDataView(TypedDict):
    """The session of this browser, in short."""

    browser: str


class WheelDataView(TypedDict):
    """The number under which a page drives."""

    wheel: int
