"""Right settings, drawn at random, some of them under their older keys."""

import functools
from typing import Any, Dict, FrozenSet, NamedTuple, Optional

from borders.setting_values import BY_NAME
from hypothesis import HealthCheck, Phase
from hypothesis import strategies as st

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.settings import GROUPS, Settings

# each example is drawn by itself. Without its own phases hypothesis makes every second one of those
# before it, ever smaller, for a score that no test here keeps
QUICK = {
    'deadline': None,
    'suppress_health_check': list(HealthCheck),
    'phases': [Phase.explicit, Phase.generate, Phase.shrink],
}
IN_GROUPS = sorted(name for group in GROUPS.texts for name in GROUPS.members(group))


def taken(values: Any) -> Optional[Settings]:
    """What settings come to, None where they are refused."""
    try:
        return Settings.from_dict(values, lambda name: taken)
    except SettingsError:
        return None


class Drawn(NamedTuple):
    """Settings by the names of their fields, and which of them a source has in groups."""

    flat: Dict[str, Any]
    moved: FrozenSet[str]

    def source(self) -> Dict[str, Any]:
        """Return them as the source has them. A short form stands alone, or in its group."""
        found: Dict[str, Any] = {}
        groups = {GROUPS.key_of(name).split('.')[0] for name in self.moved}
        for name, value in self.flat.items():
            group, _, key = GROUPS.key_of(name).partition('.')
            if key and (name in self.moved or name in groups):
                found.setdefault(group, {})[key] = value
            else:
                found[name] = value
        return found


@functools.lru_cache(maxsize=None)
def _right(name: str) -> Any:
    # an empty mapping is an empty group, but no condition
    return BY_NAME[name].filter(lambda value: value != {} and taken({name: value}) is not None)


@st.composite
def drawn_settings(draw: Any) -> Drawn:
    """Draw some settings, each of them right by itself."""
    some = st.sampled_from([*IN_GROUPS, 'memory', 'policy', 'budget', 'states'])
    flat = {name: draw(_right(name)) for name in sorted(draw(st.sets(some, max_size=6)))}
    movable = sorted(set(flat).intersection(IN_GROUPS))
    moved = draw(st.sets(st.sampled_from(movable))) if movable else ()
    return Drawn(flat, frozenset(moved))
