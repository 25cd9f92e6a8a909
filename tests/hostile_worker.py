"""Checks the files that are named on standard input, each in a process of its own with limited memory and time.

    python hostile_worker.py BYTES SECONDS

A line is a way and a path, with a tab between: ``reference`` and ``stdlib`` are the checker in Python, any other way is
the program of the verified checker, which limits itself. One line of JSON for each: what the checker said, its exit
code (negative: the signal that ended it), the largest memory in bytes and the processor time in seconds. The processes
are copies of this one, which has loaded the checker, and NumPy and python-flint with it, and nothing else.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import resource
import sys
import traceback

from lmi.exact import arithmetic
from ptcc_certify.checker import main


def child(way: str, path: str, memory: int, seconds: int, out: int) -> None:
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if way not in ("reference", "stdlib"):
        os.dup2(out, 1)
        os.dup2(out, 2)
        resource.setrlimit(resource.RLIMIT_CPU, (6 * seconds, 6 * seconds))
        os.execv(way, [way, path])
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            code = main([path] if way == "reference" else [path, "--stdlib"])
    except BaseException:
        said.write(traceback.format_exc())
        code = 70
    os.write(out, said.getvalue().encode()[-4000:])
    os._exit(code)


def run(way: str, path: str, memory: int, seconds: int) -> dict[str, object]:
    read, write = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(read)
        child(way, path, memory, seconds, write)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        text = pipe.read().decode("utf-8", "replace").strip()
    _, status, used = os.wait4(pid, 0)
    cpu = used.ru_utime + used.ru_stime
    last = text.splitlines()[-1:] or ["nothing"]
    code = os.waitstatus_to_exitcode(status)
    return {"said": last[0][:1000], "code": code, "memory": used.ru_maxrss * 1024, "seconds": cpu}


if __name__ == "__main__":
    arithmetic()  # loads what there is
    for line in sys.stdin:
        way, _, path = line.rstrip("\n").partition("\t")
        print(json.dumps(run(way, path, int(sys.argv[1]), int(sys.argv[2]))), flush=True)
