"""Run the check: ``python -m ptcc_certify.checker certificate.json [--stdlib] [--memory GB]``."""

import sys

from ptcc_certify.checker import main

sys.exit(main())
