"""XML from people that one need not trust: no document types, and no more text than allowed."""

import xml.etree.ElementTree as ElementTree


def read_xml(text: str, what: str, most: int) -> ElementTree.Element:
    """The root of an XML document without a document type.

    :param what: the document is, for the text of an error.
    :param most: characters that the text may have.
    :raises ValueError: for a longer text, one with a document type, or one that is not XML.
    """
    if len(text) > most:
        raise ValueError('{}: {} characters; allowed: {}'.format(what, len(text), most))
    if '<!doctype' in text.lower() or '<!entity' in text.lower():
        raise ValueError(
            '{}: it declares a document type or entities; that is not allowed'.format(what)
        )
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError) as err:
        raise ValueError('{}: not XML: {}'.format(what, str(err)[:200])) from err
