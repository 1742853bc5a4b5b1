"""``python -m stepwell`` is the command ``stepwell``."""

import sys

from .cli import main

sys.exit(main())
