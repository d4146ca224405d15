"""``python -m paxisim.cli`` does what ``paxisim`` does."""

import sys

from paxisim.cli import main

sys.exit(main())
