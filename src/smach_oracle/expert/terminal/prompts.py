"""Prompts for lines that an expert types.

A prompt ends when the thing that it asks about is over.
"""

import asyncio
import time
from typing import Callable, List, Optional, Sequence, Tuple

from prompt_toolkit import PromptSession
from prompt_toolkit.completion import CompleteEvent, Completer, Completion
from prompt_toolkit.document import Document
from prompt_toolkit.input import Input
from prompt_toolkit.output import Output
from prompt_toolkit.styles import Style
from prompt_toolkit.validation import ValidationError, Validator

from smach_oracle.ros.strict_json import load_json

from ..wording import clean

Choice = Tuple[str, str]  # what is typed, what it means
Reason = Callable[[], Optional[str]]  # None as long as there is no reason
_LOOK_PERIOD_S = 0.2
_STYLE = Style.from_dict({'bottom-toolbar': 'noreverse bg:#303030 #e0e0e0', 'prompt': 'bold'})


class LeaveQuestion(Exception):
    """The expert is done with this question."""


class QuitTerminal(Exception):
    """The expert is done for today."""


class PromptInterrupted(Exception):
    """The prompt ended because what it asked about is over. The text gives the reason."""


class Prompts:
    """Asks for lines: `toolbar` gives the text below them, `why_to_stop` a reason to end."""

    def __init__(
        self, terminal_input: Optional[Input] = None, terminal_output: Optional[Output] = None
    ) -> None:
        self._input = terminal_input
        self._output = terminal_output
        self._pressed_s = time.monotonic()

    @property
    def idle_s(self) -> float:
        """The time (s) for which no key was pressed."""
        return time.monotonic() - self._pressed_s

    def ask(
        self,
        message: str,
        toolbar: Callable[[], str],
        why_to_stop: Reason,
        choices: Sequence[Choice] = (),
        validator: Optional[Validator] = None,
    ) -> str:
        """Return one line, stripped.

        :raises PromptInterrupted: as soon as `why_to_stop` gives a reason.
        :raises KeyboardInterrupt: on Ctrl-C.
        :raises EOFError: on Ctrl-D.
        """
        # one session a line: what one prompt is given would otherwise stay for the next
        session: 'PromptSession[str]' = PromptSession(
            input=self._input, output=self._output, style=_STYLE, refresh_interval=0.5
        )
        session.app.key_processor.before_key_press += self._note_press
        return session.prompt(
            [('class:prompt', message)],
            bottom_toolbar=lambda: [('class:bottom-toolbar', ' ' + clean(toolbar()))],
            completer=_Choices(choices),
            complete_while_typing=bool(choices),
            validator=validator,
            validate_while_typing=False,
            reserve_space_for_menu=6 if choices else 0,
            pre_run=lambda: _watch(session, why_to_stop),
        ).strip()

    def _note_press(self, _: object) -> None:
        self._pressed_s = time.monotonic()


def _watch(session: 'PromptSession[str]', why_to_stop: Reason) -> None:
    """End the prompt as soon as `why_to_stop`, which may take its time, gives a reason."""
    app = session.app

    async def watch() -> None:
        while True:
            reason = await asyncio.get_running_loop().run_in_executor(None, why_to_stop)
            if reason is not None:
                app.exit(exception=PromptInterrupted(reason))
                return
            await asyncio.sleep(_LOOK_PERIOD_S)

    app.create_background_task(watch())


class JsonValidator(Validator):
    """Takes JSON, or nothing."""

    def validate(self, document: Document) -> None:
        """:raises ValidationError: where it is not JSON, at the place where it breaks off."""
        text = document.text.strip()
        if not text:
            return
        try:
            load_json(text)
        except (ValueError, RecursionError) as err:
            position = getattr(err, 'pos', len(text))
            raise ValidationError(
                position, 'not JSON: {}; strings need "quotes"'.format(err)
            ) from err


class _Choices(Completer):
    """Completes the line as a whole, by key or by words."""

    def __init__(self, choices: Sequence[Choice]) -> None:
        self._choices: List[Choice] = list(choices)

    def get_completions(
        self, document: Document, complete_event: CompleteEvent
    ) -> List[Completion]:
        """Return all choices that fit: by the beginning of the key, or of a word of the meaning."""
        typed = document.text_before_cursor.lstrip().lower()
        return [
            Completion(
                key,
                -len(document.text_before_cursor),
                display=clean(key),
                display_meta=clean(meaning),
            )
            for key, meaning in self._choices
            if _fits(typed, key, meaning)
        ]


def _fits(typed: str, key: str, meaning: str) -> bool:
    words = meaning.lower().split()
    return key.lower().startswith(typed) or any(
        ' '.join(words[start:]).startswith(typed) for start in range(len(words))
    )
