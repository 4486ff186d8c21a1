"""Texts that rospy can send. Pure."""

from smach_common.foreign import text_of


def sendable_text(value: object) -> str:
    """Return a string that UTF-8 can encode.

    An exception's text may hold halves of surrogate pairs (from a file name, say). rospy would send
    the message up to there and garble the connection for the messages that follow.
    """
    kind = type(value)  # `isinstance` asks the object itself, which may raise
    # a label may be a member of an Enum that is text, too
    text = str.__str__(value) if issubclass(kind, str) else text_of(value)
    if text.isascii():
        return text
    return text.encode('utf-8', 'backslashreplace').decode('utf-8')
