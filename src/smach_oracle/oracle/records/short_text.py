"""Makes foreign texts, such as a traceback, fit for a line or a page. Pure, and without smach."""

import re

LEFT_OUT = ' … '
_UNSEEN = re.compile(
    '[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff\ufff9-\ufffb'
    '\ufffe\uffff\ud800-\udfff]'
)


def shortened(text: str, longest: int) -> str:
    """Return a text of at most `longest` letters: a long one without its middle.

    The head of an exception has its type and reason, and so may its tail.
    """
    if len(text) <= longest:
        return text
    kept = max(0, longest - len(LEFT_OUT))
    tail = kept // 2
    return text[: kept - tail] + LEFT_OUT + text[len(text) - tail :]


def seen(text: str) -> str:
    """Return a text with a sign for each letter that steers a terminal or a page.

    These are control characters, and marks that turn the direction of what follows. Tabs and ends
    of lines stay.
    """
    return _UNSEEN.sub('\ufffd', text)
