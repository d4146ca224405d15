"""``python -m paxisim``, and what the installed command runs: light, so that Ctrl-C while the rest loads is caught."""

from __future__ import annotations

import sys


def main() -> int:
    """Run a verb, see `paxisim.cli.main`.

    Returns:
        Its exit status; 130 after Ctrl-C.
    """
    try:
        from paxisim.cli import main as run

        return run()
    except KeyboardInterrupt:
        print("paxisim: interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
