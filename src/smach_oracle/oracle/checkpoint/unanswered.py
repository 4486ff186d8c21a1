"""A question whether a stored trial may go on: where nobody answers, the trial is kept."""
from ..asking.question import Question
from ..recovery.arrival_recovery import ArrivalRecovery
from ..recovery.recovery import Recovery
from ..recovery.stop import preempt_beside
from ..recovery.verdict import Verdict, VerdictKind

KEPT = ('nobody has said how the trial goes on ({}). The machine stops where it stands, and the '
        'trial is kept. The next start asks again. `oracle_run --resume` asks only before a state '
        'that on_retry protects, if the script has changed (unless --resume-map says how), and if '
        'the store may have lost something. `oracle_state {} drop` ends the trial')


class _Keeping(Recovery):
    """Asks before anything moves, whatever `on_no_answer` says of other questions."""

    def say_that_it_waits(self, question: Question) -> None:
        """Log that it waits, and what happens without an answer."""
        self._say_that_it_waits(question, 'the trial is kept')

    def _fallback_in_words(self) -> str:
        return 'stop, and keep the trial for the next start'

    def _fall_back(self, why: str) -> Verdict:
        return self._keep(why)

    def _give_up(self, text: str, outcome: str = '') -> Verdict:
        return self._keep(text)

    def _end_unaided(self) -> Verdict:
        return self._keep(self._budget.why_over())

    def _keep(self, why: str) -> Verdict:
        node = self._node
        self.warn(KEPT.format(why, node.settings.checkpoint))
        node.tree.early_end.keep()
        preempt_beside(node)
        return Verdict(VerdictKind.PREEMPTED)


class KeepingRecovery(_Keeping, ArrivalRecovery):
    """Asks whether the trial may go on."""


class KeepingHeldBack(_Keeping):
    """Asks about a state that is not to be repeated, at which the trial would go on."""
