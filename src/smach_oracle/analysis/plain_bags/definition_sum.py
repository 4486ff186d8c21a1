"""The MD5 sum of a message definition, as ROS makes it: tells whether a definition is sound.

Source: http://wiki.ros.org/ROS/Technical%20Overview#Message_serialization_and_msg_MD5_sums. The
text has no comments, the constants come first, and the name of another message is its own sum.
"""

import hashlib
import re
from typing import Dict, List

from .indexed_bag import NotPlain

_BETWEEN = re.compile(r'^=+$', re.MULTILINE)  # the definitions of a message and those that it has
_CONSTANT = re.compile(r'(u?int(?:8|16|32|64)|bool|byte|char) +(\w+) *= *(-?\d+)')
_FIELD = re.compile(r'([\w/]+)((?:\[\d*\])?) +(\w+)')
_PLAIN = re.compile(r'u?int(?:8|16|32|64)|float(?:32|64)|bool|byte|char|string|time|duration')


def sum_of(definition: str) -> str:
    """Return the sum of a definition with those of the messages in it, in hexadecimal digits.

    :raises NotPlain: for what is seldom, such as a constant that is a text, and for other text.
    """
    first, *others = _BETWEEN.split(definition)
    named: Dict[str, str] = {}
    for other in others:
        head, _, text = other.strip().partition('\n')
        word, _, name = head.partition(' ')
        if word != 'MSG:':
            raise NotPlain('a definition without a name')
        named[name.strip()] = text
    return _sum(first, named)


def _sum(text: str, named: Dict[str, str]) -> str:
    constants: List[str] = []
    fields: List[str] = []
    for line in text.split('\n'):
        words = line.split('#')[0].strip()
        constant, field = _CONSTANT.fullmatch(words), _FIELD.fullmatch(words)
        if constant:
            constants.append('{} {}={}'.format(*constant.groups()))
        elif field:
            kind, number, name = field.groups()
            fields.append(_field(kind, number, name, named))
        elif words:
            raise NotPlain('a line {!r}'.format(words))
    return hashlib.md5('\n'.join(constants + fields).encode()).hexdigest()


def _field(kind: str, number: str, name: str, named: Dict[str, str]) -> str:
    if _PLAIN.fullmatch(kind):
        return '{}{} {}'.format(kind, number, name)
    kind = {'Header': 'std_msgs/Header'}.get(kind, kind)  # another one is of the same package
    known = [each for each in named if each == kind or each.endswith('/' + kind)]
    if not known:
        raise NotPlain('no definition of {}'.format(kind))
    others = {each: text for each, text in named.items() if each != known[0]}  # it is not in itself
    return '{} {}'.format(_sum(named[known[0]], others), name)
