"""python -m pbem is the same as pbem."""

import sys

from pbem.cli import main

sys.exit(main())
