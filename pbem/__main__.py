"""The process of `pbem`, and of `python -m pbem`: the command line, and an interruption while it is being imported."""

import os
import sys
import time


def main() -> int:
    """Run the program with the arguments of the process; returns the exit code."""
    try:
        from pbem.cli import main as run_command_line
    except KeyboardInterrupt:
        return _report_interruption()
    return run_command_line()


def _report_interruption() -> int:
    """What the command line does with an interruption (pbem.cli), of which not all may be there yet."""
    from pbem.environment import find_launch
    from pbem.terminal import INTERRUPTED, say

    rank = find_launch(os.environ).rank
    say("pbem: interrupted", rank)
    if rank > 0:  # the launcher ends the others when it sees one end: the first must have spoken by then
        time.sleep(1.0)
    return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
