"""How a command ends early: by a signal, or by an error whose lines go to stderr and whose exit code it leaves."""

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from typing import NoReturn

import click

from radarsim.errors import Interruption, RadarsimError, StoreError

NO_THREAD = "can't start new thread"  # in Python's words
PATIENCE_S = 1.0  # from a signal to the end of whatever a command is doing


@contextlib.contextmanager
def stop_on_signals() -> Iterator[None]:
    """While entered, SIGINT and SIGTERM end a command, and files being written are removed.

    An exception from a handler may be turned into another one on its way, as by an import, or be swallowed, as by the
    finalisers that Python calls at any time; then the process ends at once a little later. Runs, which store their
    results, handle both signals themselves meanwhile. A signal that is ignored (nohup) stays so."""
    numbers = [number for number in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(number) is not signal.SIG_IGN]
    if threading.current_thread() is not threading.main_thread():
        numbers = []

    received: list[Interruption] = []

    def stop(number: int, frame: object) -> NoReturn:
        error = Interruption(number, goes_on=False)
        received.append(error)
        timer = threading.Timer(PATIENCE_S, fail, (error,))
        timer.daemon = True
        timer.start()
        raise error

    default_hook = sys.unraisablehook

    def hide_interruption(unraisable: "sys.UnraisableHookArgs") -> None:
        """Do not print a handler's exception that Python has to swallow: the process ends a little later."""
        if not isinstance(unraisable.exc_value, Interruption):
            default_hook(unraisable)

    earlier_handlers = {number: signal.signal(number, stop) for number in numbers}
    sys.unraisablehook = hide_interruption
    try:
        yield
    except Exception:
        if received:
            raise received[0] from None
        raise
    finally:
        sys.unraisablehook = default_hook
        for number, handler in earlier_handlers.items():
            signal.signal(number, handler)


def fail(error: RadarsimError) -> NoReturn:
    """Report a fault, a line each, and leave with its exit code."""
    from radarsim.cli.console import break_lines

    sys.stdout.flush()  # what was found stands before what failed where both streams go into one file
    for line in dict.fromkeys(error.lines):
        for broken_line in break_lines(line, sys.stderr):
            click.echo(broken_line, err=True)
    if isinstance(error, Interruption):
        # The interpreter's orderly end takes most of a second, which whoever sent the signal need not wait for.
        os._exit(error.exit_code)
    sys.exit(error.exit_code)


def file_error(error: OSError) -> StoreError:
    """What a user is told of a file that the system refuses."""
    return StoreError(f"{error.filename or 'a file'}: cannot be read or written: {error.strerror or error}")
