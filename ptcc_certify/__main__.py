"""``python -m ptcc_certify``: the command line ``ptcc``, where the packages that it needs are installed."""

import sys

#: Modules that two distributions share: uninstalling one takes the files of both away, and pip takes the other for
#: whole.
_SHARED = {"cvxpy": "pip uninstall -y cvxpy-base && pip install cvxpy-base"}


def main() -> None:
    """Run ``ptcc``; where a package is missing tell so, and what works without any."""
    try:
        from ptcc_certify.cli import main as run

        run()
    except ModuleNotFoundError as error:
        mend = _SHARED.get((error.name or "").partition(".")[0], "pip install . in the project's folder")
        what = f"ptcc needs the package {error.name}, which is not installed; {mend}"
        without = "without other packages: python -m ptcc_certify.checker CERTIFICATE"
        print(f"ptcc: {what}; {without}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
