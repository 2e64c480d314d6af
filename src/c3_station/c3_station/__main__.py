"""``python -m c3_station``: the command line of ``orchestrate.py``, inside the environment."""

import sys

from c3_station.cli import main

sys.exit(main(sys.argv[1:]))
