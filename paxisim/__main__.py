"""Entry point of ``python -m paxisim`` and of the installed command.

It imports the rest inside `main`, so that Ctrl-C during loading is caught.
"""

from __future__ import annotations

import sys


def main() -> int:
    """Run a command, see `paxisim.cli.main`.

    Returns:
        Exit status of the command; 130 after Ctrl-C.
    """
    try:
        from paxisim.cli import main as run

        return run()
    except KeyboardInterrupt:
        print("paxisim: interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
