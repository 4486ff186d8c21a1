"""Words and dictionaries that several shapes use."""

from typing import Dict, Literal, Tuple, TypeVar

Value = TypeVar('Value')
ByKey = Dict[str, Value]  # by the key of a question
ByState = Dict[str, Value]  # by the label of a state
ByPath = Dict[str, Value]  # by the path of a container

# Texts of which the scripts get a closed set: doc/write_page_types.py has the constants for it.
Role = str
DriveFrame = str
OutcomeMeaning = str  # of the work
TrialEnd = str
EventName = str
SensorKind = Literal['image', 'cloud', 'robot', 'joints']
HealthLevel = Literal['warn', 'error', 'stale']
CallStatus = Literal['waiting', 'sent', 'failed', 'dropped']
FailureClass = int  # none, low, moderate, high
Vector = Tuple[float, float, float]  # x, y, z
Size = Tuple[int, int]  # width, height, px
