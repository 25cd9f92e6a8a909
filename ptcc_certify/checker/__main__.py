"""Run the check: ``python -m ptcc_certify.checker certificate.json [--stdlib] [--memory GB]``."""

import sys

from ptcc_certify.checker import main

try:
    code = main()
    print(end="", flush=True)
except BrokenPipeError:  # who reads the output has gone; the code is that of other programs then
    sys.stdout, code = sys.stderr, 141
except OSError as error:
    sys.stdout, code = sys.stderr, 2
    print(f"checker: the result cannot be written ({error.strerror})", file=sys.stderr)
except KeyboardInterrupt:
    sys.exit(130)
sys.exit(code)
