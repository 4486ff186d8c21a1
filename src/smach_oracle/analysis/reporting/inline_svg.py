"""The figures of matplotlib as SVG that stands in a page."""

import io
import re
import xml.etree.ElementTree as ElementTree
from typing import Any, Dict, Sequence

from matplotlib import rc_context

from ..counting.trial_summary import TrialSummary
from ..figure import STYLE, draw_time_series

_SVG, _XLINK = '{http://www.w3.org/2000/svg}', '{http://www.w3.org/1999/xlink}'
_USED = re.compile(r'url\(#([^)]+)\)')
_LEFT_OUT = ('metadata', 'title', 'style')  # a style would be of the whole page


def time_series_svg(trials: Sequence[TrialSummary], x_axis: str, prefix: str) -> str:
    """Return the figure of bag_statistics as an <svg> element. Its text is text.

    :param x_axis: as in `draw_time_series`.
    :param prefix: of the ids in it, which a page must have once.
    """
    target = io.StringIO()
    style: Dict[str, Any] = {**STYLE, 'svg.fonttype': 'none'}
    with rc_context(style):
        figure = draw_time_series(trials, 1, x_axis)
        figure.savefig(target, format='svg', metadata={'Date': None, 'Creator': None})
    return for_page(target.getvalue(), prefix)


def for_page(text: str, prefix: str) -> str:
    """Return an SVG file as an element of a page: without namespaces, with ids of its own.

    :raises xml.etree.ElementTree.ParseError: where it is no XML.
    """
    root = ElementTree.fromstring(text)
    used = set(_USED.findall(text)) | {
        value[1:] for each in root.iter() for name, value in each.items() if name == _XLINK + 'href'
    }
    renamed = {name: '{}-{}'.format(prefix, at) for at, name in enumerate(sorted(used))}
    for parent in root.iter():
        for child in list(parent):
            if child.tag in [_SVG + name for name in _LEFT_OUT]:
                parent.remove(child)
    for each in root.iter():
        each.tag = each.tag.replace(_SVG, '')
        _rename(each.attrib, renamed)
    for name in ('width', 'height', 'version'):
        root.attrib.pop(name, None)
    return ElementTree.tostring(root, encoding='unicode')


def _rename(attributes: Dict[str, str], renamed: Dict[str, str]) -> None:
    for name, value in list(attributes.items()):
        if name == 'id':
            del attributes[name]
            if value in renamed:
                attributes[name] = renamed[value]
        elif name.startswith(_XLINK):
            del attributes[name]
            attributes[name[len(_XLINK) :]] = '#' + renamed[value[1:]]
        else:
            attributes[name] = _USED.sub(
                lambda match: 'url(#{})'.format(renamed[match.group(1)]), value
            )
