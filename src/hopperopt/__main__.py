"""`python -m hopperopt`."""

import sys

from hopperopt.cli import main

sys.exit(main())
