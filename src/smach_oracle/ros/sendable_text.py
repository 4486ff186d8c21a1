"""Texts that rospy can send. Pure."""


def sendable_text(value: object) -> str:
    """Return a string that UTF-8 can encode.

    An exception's text may hold halves of surrogate pairs (from a file name, say). rospy would send
    the message up to there and garble the connection for the messages that follow.
    """
    text = value if isinstance(value, str) else str(value)
    if text.isascii():
        return text
    return text.encode('utf-8', 'backslashreplace').decode('utf-8')
