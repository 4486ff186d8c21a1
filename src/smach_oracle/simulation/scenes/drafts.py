"""Scenes to which causes are being added."""
from typing import Any, Callable, Protocol, Tuple, TypeVar

from .scene import Disturbance, SceneCause


class SceneDraft(Protocol):
    """What the drafts of all tasks have; each is a NamedTuple."""

    @property
    def disturbances(self) -> Tuple[Disturbance, ...]:
        """What happens in the course of the trial."""

    @property
    def causes(self) -> Tuple[SceneCause, ...]:
        """Why the trial may fail."""

    @property
    def _replace(self) -> Callable[..., Any]:
        """That of a NamedTuple."""


Draft = TypeVar('Draft', bound=SceneDraft)


def caused(draft: Draft, kind: str, text: str, *disturbances: Disturbance) -> Draft:
    """The draft with one more cause, and with what that makes happen.

    :param kind: as in SceneCause.
    :param text: likewise.
    """
    changed: Draft = draft._replace(disturbances=draft.disturbances + disturbances,
                                    causes=draft.causes + (SceneCause(kind, text),))
    return changed
