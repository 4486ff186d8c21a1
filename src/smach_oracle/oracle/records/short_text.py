"""Cuts long texts, such as a traceback, for a line or a page. Pure, and without smach."""

LEFT_OUT = ' … '


def shortened(text: str, longest: int) -> str:
    """Return a text of at most `longest` letters: a long one without its middle.

    The head of an exception has its type and reason, and so may its tail.
    """
    if len(text) <= longest:
        return text
    kept = max(0, longest - len(LEFT_OUT))
    tail = kept // 2
    return text[: kept - tail] + LEFT_OUT + text[len(text) - tail :]
