"""From an expert's answer to the verdict that obeys it."""
from typing import Callable

from ..asking.question import Answer, AnswerKind
from ..machine.tree_node import TreeNode
from ..machine.write_watch import WriteWatch
from .failure import ContainerEnding
from .verdict import Verdict, VerdictKind


def verdict_of(answer: Answer, node: TreeNode, label: str, watch: WriteWatch,
               natural_ending: Callable[[], ContainerEnding]) -> Verdict:
    """Write the outputs of an answer about a state, and return the way out of the meta state.

    `natural_ending`: how the container ends where the answer gives up without an outcome.
    """
    remapping = node.machine._remappings.get(label) or {}
    for key, value in (answer.outputs or {}).items():
        watch.gate[remapping.get(key, key)] = value
    if answer.kind is AnswerKind.GOTO:
        return Verdict(VerdictKind.JUMP, state=answer.state, by=answer.by, text=answer.why,
                       written=frozenset(watch.written()))
    if answer.kind is AnswerKind.SUPERSEDE:
        return Verdict(VerdictKind.SUPERSEDE, outcome=answer.outcome, by=answer.by,
                       text=answer.why)
    ending = ContainerEnding(outcome=answer.outcome) if answer.outcome else natural_ending()
    return Verdict(VerdictKind.GIVE_UP, ending=ending, by=answer.by, text=answer.why)
