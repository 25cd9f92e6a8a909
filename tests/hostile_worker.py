"""Checks the files that are named on standard input, each in a process of its own with limited memory and time.

    python hostile_worker.py BYTES SECONDS

One line of JSON for each: what the checker said, its exit code (negative: the signal that ended it), the largest memory
in bytes and the processor time in seconds. The processes are copies of this one, which has loaded the checker, and
NumPy and python-flint with it, and nothing else.
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


def child(path: str, memory: int, seconds: int, out: int) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            code = main([path])
    except BaseException:
        said.write(traceback.format_exc())
        code = 70
    os.write(out, json.dumps([code, said.getvalue().strip().splitlines()[-1:]]).encode()[:4000])
    os._exit(0)


def run(path: str, memory: int, seconds: int) -> dict[str, object]:
    read, write = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(read)
        child(path, memory, seconds, write)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        text = pipe.read()
    _, status, used = os.wait4(pid, 0)
    code, said = json.loads(text) if text else (os.waitstatus_to_exitcode(status), ["ended by a signal"])
    if os.WIFSIGNALED(status):
        code = -os.WTERMSIG(status)
    cpu = used.ru_utime + used.ru_stime
    return {"said": " ".join(said), "code": code, "memory": used.ru_maxrss * 1024, "seconds": cpu}


if __name__ == "__main__":
    arithmetic()  # loads what there is
    for line in sys.stdin:
        print(json.dumps(run(line.rstrip("\n"), int(sys.argv[1]), int(sys.argv[2]))), flush=True)
