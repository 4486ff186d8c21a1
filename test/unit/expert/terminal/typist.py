"""Keys for a terminal under test: typed when the screen shows what they answer to, and never waited
for without end.
"""

import contextlib
import threading

from prompt_toolkit.input import create_pipe_input
from waiting import wait_for

ENTER, CTRL_C, CTRL_D, CTRL_U = '\r', '\x03', '\x04', '\x15'
PATIENCE_S = 60.0


@contextlib.contextmanager
def typist(shown, typed, script=()):
    """A terminal's input that types at once what is given, and goes on as the script says.

    `shown`: a function for what is on the screen. `script`: pairs of what is waited for, words on
    the screen or a function, and what comes then, keys or a function. Where it waits in vain, or
    the terminal does not end after it, Ctrl-C ends the terminal.
    """
    over = threading.Event()

    def came(awaited):
        return wait_for(
            lambda: over.is_set() or (awaited() if callable(awaited) else awaited in shown()),
            PATIENCE_S,
        )

    def work(keys):
        for awaited, then in script:
            if not came(awaited) or over.is_set():
                break
            then() if callable(then) else keys.send_text(then)
        over.wait(PATIENCE_S)
        while not over.wait(0.5):
            keys.send_text(CTRL_C)

    with create_pipe_input() as keys:
        keys.send_text(typed)
        thread = threading.Thread(target=work, args=(keys,), daemon=True)
        thread.start()
        try:
            yield keys
        finally:
            over.set()
            thread.join()
