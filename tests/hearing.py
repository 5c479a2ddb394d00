"""Children of the tests that hear Ctrl-C and a closing terminal."""

import signal


def hear_signals():
    """Call it in a child, as `preexec_fn`: nohup and the background of a script start the tests with these ignored."""
    for number in (signal.SIGHUP, signal.SIGINT):
        signal.signal(number, signal.SIG_DFL)
