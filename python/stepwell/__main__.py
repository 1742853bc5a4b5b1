"""``python -m stepwell`` is the command ``stepwell``."""

import sys

from .views.cli import main

sys.exit(main())
