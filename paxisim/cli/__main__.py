"""Run the shell command as ``python -m paxisim.cli``."""

import sys

from paxisim.cli import main

sys.exit(main())
