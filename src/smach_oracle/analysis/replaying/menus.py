"""Reads the menu that a decision was made from, as its event tells it."""

from typing import Any, Mapping, NamedTuple, Optional, Tuple

from smach_oracle.oracle.decision.policy import Menu, Past
from smach_oracle.oracle.decision.ways import Prices, StreakSoFar, Way, WayKind
from smach_oracle.oracle.records.events import Event

_PRICE = 'cost.'


class RecordedMenu(NamedTuple):
    """What a policy that goes by ways chose from."""

    menu: Menu
    past: Past


def recorded_menu(event: Event, settings: Mapping[str, Any]) -> Optional[RecordedMenu]:
    """Return the menu that a DECISION event has, None where it has none that can be read.

    :param settings: by which the prices go.
    """
    data = _told(event)
    try:
        menu = Menu(
            tuple(_way(each) for each in data['menu']),
            _streak(data['streak']),
            prices_of(settings),
            bool(data['has_expert']),
        )
        usual = data['usual_minutes']
        past = Past(
            attempts=int(data['attempts']), usual_minutes=None if usual is None else float(usual)
        )
        return RecordedMenu(menu, past)
    except (AttributeError, KeyError, TypeError, ValueError):
        return None


def prices_of(settings: Mapping[str, Any]) -> Prices:
    """Return the prices that an oracle goes by, by its recorded settings."""
    return Prices(**{key[len(_PRICE) :]: settings[key] for key in settings if key in _PRICES})


def chosen_way(event: Event) -> str:
    """Return the key of the way that was chosen, '' where none was."""
    return next(iter(order_of(event)), '')


def order_of(event: Event) -> Tuple[str, ...]:
    """Return the keys of the ways in the order in which the policy would go them."""
    order = _told(event).get('order')
    return tuple(map(str, order)) if isinstance(order, (list, tuple)) else ()


def offers_preconditions(event: Event) -> bool:
    """Whether the menu has a way that runs the preconditions of the failed state."""
    menu = recorded_menu(event, {})
    return menu is not None and any(way.kind is WayKind.PREPARE for way in menu.menu.ways)


def _told(event: Event) -> Mapping[str, Any]:
    return event.data if isinstance(event.data, Mapping) else {}


_PRICES = frozenset(_PRICE + name for name in Prices._fields)


def _way(told: Mapping[str, Any]) -> Way:
    way = Way(**told)
    return way._replace(kind=WayKind(way.kind), repeats=tuple(map(str, way.repeats)))


def _streak(told: Mapping[str, Any]) -> StreakSoFar:
    streak = StreakSoFar(**told)
    return streak._replace(tried=tuple(map(str, streak.tried)))
