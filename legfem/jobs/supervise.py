"""The process that waits for the command of a run, whose folder it is given.

It leads a session of its own, so that a run outlives the server that started it, writes the
exit status, which nobody else could learn then, and starts the run that is to follow.
"""

import fcntl
import json
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path


def started(folder: Path) -> bool:
    """Start the command of a run's folder, unless it runs; return whether it was started."""
    with (folder / "lock").open("wb") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        for name in ("exit.json", "session.json"):
            (folder / name).unlink(missing_ok=True)
        log = folder / "log.txt"
        log_from = log.stat().st_size if log.is_file() else 0
        process = subprocess.Popen(
            [sys.executable, "-m", "legfem.jobs.supervise", str(folder), str(lock.fileno())],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            pass_fds=(lock.fileno(),),
        )
        # Written here, so that a run can be ended from its first moment on.
        _written(folder / "session.json", {"leader": process.pid, "log_from": log_from})
    return True


def main(folder: Path, lock: int) -> None:
    """Run the command in ``run.json``; its output goes to ``out.txt``, its messages to ``log.txt``.

    Parameters
    ----------
    folder : Path
        The run's.
    lock : int
        Descriptor of its lock file, locked; what the command starts holds it too.
    """
    # Ctrl-C reaches the whole session: it is the command's to answer.
    signal.signal(signal.SIGINT, lambda number, frame: None)
    given = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    with (folder / "out.txt").open("wb") as out, (folder / "log.txt").open("ab") as log:
        try:
            process = subprocess.Popen(
                given["arguments"], stdin=subprocess.DEVNULL, stdout=out, stderr=log, cwd=given["cwd"], pass_fds=(lock,)
            )
        except OSError as error:
            log.write(f"{error.filename}: {error.strerror}\n".encode())
            status = 1
        else:
            status = process.wait()
    _written(folder / "exit.json", {"status": status, "ended": time.time()})
    following = folder.with_name(given.get("then") or ".")
    if status == 0 and (following / "run.json").is_file():
        started(following)


def _written(path: Path, content: Mapping[str, float]) -> None:
    """Write a file whole; `legfem.common.documents` would bring NumPy to every run."""
    unfinished = path.with_name(f".{path.name}")
    unfinished.write_text(json.dumps(content) + "\n")
    unfinished.replace(path)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
