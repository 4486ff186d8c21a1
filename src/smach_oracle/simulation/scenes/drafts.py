"""Scenes to which causes are being added."""

from typing import Any, Callable, Collection, Protocol, Tuple, TypeVar

from .scene import Disturbance, SceneCause


class SceneDraft(Protocol):
    """The fields that the drafts of all tasks have. Each is a NamedTuple."""

    @property
    def disturbances(self) -> Tuple[Disturbance, ...]:
        """The disturbances in the course of the trial."""

    @property
    def causes(self) -> Tuple[SceneCause, ...]:
        """The causes for which the trial may fail."""

    @property
    def _replace(self) -> Callable[..., Any]:
        """Return the method of a NamedTuple."""


Draft = TypeVar('Draft', bound=SceneDraft)


def caused(
    draft: Draft, kind: str, text: str, *disturbances: Disturbance, until: Tuple[str, ...] = ()
) -> Draft:
    """The draft with one more cause, and with what that makes happen.

    :param kind: as in SceneCause.
    :param text: likewise.
    :param until: likewise.
    """
    belonging = tuple(each._replace(cause=kind) for each in disturbances)
    changed: Draft = draft._replace(
        disturbances=draft.disturbances + belonging,
        causes=draft.causes + (SceneCause(kind, text, until),),
    )
    return changed


def declared(draft: Draft, lasting: Collection[str]) -> Draft:
    """The draft whose causes say whether they last.

    :param lasting: the kinds that do.
    """
    changed: Draft = draft._replace(
        causes=tuple(each._replace(lasting=each.kind in lasting) for each in draft.causes)
    )
    return changed
