"""Values of a settings file that know how they are written. Pure.

YAML reads ON as true, 2 as a number and ~ as nothing. Whether a label or a value is meant depends
on the setting. So a value from a file keeps its text: `as_text` gives what stands there, and
`as_value` what YAML reads.
"""

from typing import Mapping, Optional, Tuple


class WrittenWord(str):
    """A text that YAML reads as true, false or nothing. `value`: that."""

    value: Optional[bool]

    def __new__(cls, text: str, value: Optional[bool]) -> 'WrittenWord':
        """Make one of its text and its value."""
        word = super().__new__(cls, text)
        word.value = value
        return word

    def __reduce__(self) -> Tuple[object, ...]:
        return WrittenWord, (str(self), self.value)


class WrittenInt(int):
    """A whole number. `text`: how it is written."""

    text: str


class WrittenFloat(float):
    """A number. `text`: how it is written."""

    text: str


def as_text(value: object) -> object:
    """Return what a file says, where a name is expected. Any other value is returned as it is."""
    if isinstance(value, (WrittenInt, WrittenFloat)):
        return value.text
    return str(value) if isinstance(value, WrittenWord) else value


def as_value(value: object) -> object:
    """Return what YAML reads, where true, false or nothing may be meant. Others are as they are."""
    return value.value if isinstance(value, WrittenWord) else value


def plain(value: object) -> object:
    """Return plain data, as YAML reads them, of what a file holds."""
    if isinstance(value, Mapping):
        return {name: plain(each) for name, each in value.items()}
    if isinstance(value, list):
        return [plain(each) for each in value]
    if isinstance(value, WrittenInt):
        return int(value)
    return float(value) if isinstance(value, WrittenFloat) else as_value(value)


def read_otherwise(value: object) -> str:
    """Say how YAML has read a name that is no text any more, or '' where it has not."""
    if isinstance(value, bool):
        return '. YAML reads {0} as {1}: write "{0}"'.format(
            *(('ON', 'true') if value else ('OFF', 'false'))
        )
    if isinstance(value, (int, float)):
        return '. YAML reads {0} as a number: write "{0}"'.format(value)
    return ''
