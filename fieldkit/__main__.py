"""`python -m fieldkit`, for where the console script is not on the path."""

import sys

from fieldkit.cli.main import main

sys.exit(main())
