"""``python -m ptcc_certify``: the command line ``ptcc``."""

from ptcc_certify.cli import main

if __name__ == "__main__":
    main()
