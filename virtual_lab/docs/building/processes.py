"""Processes of the pages: each kernel and command starts with all libraries loaded.

To load them takes longer than most cells of a page. Therefore one process loads them once, and its
copies (fork) run the kernels and commands. `python -m building.processes` is this process.
"""

import atexit
import gc
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import traceback
from contextlib import suppress
from importlib import import_module
from pathlib import Path

from ipykernel.kernelspec import get_kernel_dict
from sphinx.application import Sphinx

KERNEL, COMMAND = "page-kernel", "virtual-lab"  # programs that a copy can run
PROGRAM = """#!{python} -ISs
import json, os, signal, socket, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)  # a kernel is interrupted before it ends
with socket.socket(socket.AF_UNIX) as door:
    door.connect({address!r})
    socket.send_fds(door, [b"-"], [0, 1, 2])
    door.sendall(json.dumps([sys.argv, os.getcwd(), dict(os.environ)]).encode())
    door.shutdown(socket.SHUT_WR)
    sys.exit(int(door.recv(9) or 1))
"""


def _serve(listener: socket.socket) -> None:
    """Load the libraries, then run each program that asks, until the build ends."""
    build = os.getppid()
    listener.settimeout(10)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
    import virtual_lab as vl  # first, as it sets the threads of numpy

    for name in ("matplotlib.backends.backend_agg", "ipykernel.kernelapp", "virtual_lab.cli"):
        import_module(name)
    vl.certify("r161", progress=lambda *_: None).plot()
    gc.freeze()  # a copy's garbage collection skips all this
    try:
        while os.getppid() == build:  # a build that is killed sends no signal
            try:
                door, _ = listener.accept()
            except TimeoutError:
                continue
            if os.fork() == 0:
                _run(door)
            door.close()
            with suppress(ChildProcessError):
                while os.waitpid(-1, os.WNOHANG)[0]:
                    pass
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        os.killpg(0, signal.SIGTERM)
        with suppress(ChildProcessError):
            while os.wait():  # so that their processor time is counted
                pass


def _run(door: socket.socket) -> None:
    """Run a program in this copy, with folder, environment and streams of the one who asks."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    _, streams, *_ = socket.recv_fds(door, 1, 3)
    with door.makefile("rb") as request:
        sys.argv, folder, environment = json.load(request)
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    sys.stdout = open(1, "w", encoding="utf-8")  # noqa: SIM115
    sys.stderr = open(2, "w", encoding="utf-8", buffering=1)  # noqa: SIM115
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    code: object = 0
    try:
        if Path(sys.argv[0]).name == KERNEL:
            from ipykernel.kernelapp import IPKernelApp

            # the kernel ends with this process
            IPKernelApp.launch_instance(argv=sys.argv[1:], parent_handle=os.getppid())
        else:
            from virtual_lab.__main__ import main

            main()
    except SystemExit as end:
        code = end.code or 0
    except BaseException:
        traceback.print_exc()
        code = 1
    finally:
        with suppress(OSError):  # the reader of a pipe, or the program, may have ended
            sys.stdout.flush()
            door.sendall(str(code).encode())
        os._exit(0)


def setup(_app: Sphinx) -> dict[str, bool]:
    """Start the process, and let pages find its programs: `virtual-lab`, and the kernel.

    The result states that Sphinx may process pages in parallel.
    """
    folder = Path(tempfile.mkdtemp())
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(folder / "door"))
    listener.listen()
    for name in (KERNEL, COMMAND):
        program = folder / name
        program.write_text(PROGRAM.format(python=sys.executable, address=str(folder / "door")))
        program.chmod(0o700)
    spec = folder / "kernels" / "python3" / "kernel.json"
    spec.parent.mkdir(parents=True)
    argv = [str(folder / KERNEL), "-f", "{connection_file}"]
    spec.write_text(json.dumps(get_kernel_dict() | {"argv": argv}))
    paths = {"PYTHONPATH": str(Path(__file__).parents[1])}
    server = subprocess.Popen(
        [sys.executable, "-m", "building.processes"],
        stdin=listener,
        env=os.environ | paths | {"MPLBACKEND": "module://matplotlib_inline.backend_inline"},
        process_group=0,
    )
    os.environ["PATH"] = os.pathsep.join([str(folder), os.environ["PATH"]])
    os.environ["JUPYTER_PATH"] = str(folder)

    def end() -> None:
        server.terminate()
        server.wait()
        shutil.rmtree(folder)

    atexit.register(end)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


if __name__ == "__main__":
    _serve(socket.socket(fileno=0))
