"""``python -m ptcc_certify``: the command line ``ptcc``, where the packages that it needs are installed."""

import sys


def main() -> None:
    """Run ``ptcc``; where a package is missing tell so, and what works without any."""
    try:
        from ptcc_certify.cli import main as run

        run()
    except ModuleNotFoundError as error:
        what = f"ptcc needs the package {error.name}, which is not installed; pip install . in the project's folder"
        without = "without other packages: python -m ptcc_certify.checker CERTIFICATE"
        print(f"ptcc: {what}; {without}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
