"""``python -m ptcc_certify.cli``."""

from ptcc_certify.cli import main

if __name__ == "__main__":
    main()
