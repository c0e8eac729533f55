"""A Slurm of one machine: munge, a controller, and nodes of one processor each."""

from __future__ import annotations

import os
import secrets
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

NEEDS = ("munged", "slurmctld", "slurmd", "sbatch")


def missing() -> list[str]:
    return [name for name in NEEDS if shutil.which(name) is None]


def _free_ports(count: int) -> list[int]:
    held = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [one.getsockname()[1] for one in held]
    for one in held:
        one.close()
    return ports


@contextmanager
def slurm(folder: Path, nodes: int) -> Iterator[dict[str, str]]:
    """Yield the environment in which sbatch submits to it."""
    folder.mkdir(mode=0o755)
    host = socket.gethostname().split(".")[0]
    key, sock = folder / "munge.key", folder / "munge.socket"
    key.write_bytes(secrets.token_bytes(128))
    key.chmod(0o400)
    control, *ports = _free_ports(nodes + 1)
    (folder / "cgroup.conf").write_text("CgroupPlugin=disabled\n")
    lines = [
        "ClusterName=here",
        f"SlurmctldHost={host}(127.0.0.1)",
        f"SlurmctldPort={control}",
        "AuthType=auth/munge",
        f"AuthInfo=socket={sock}",
        "CredType=cred/munge",
        f"SlurmUser={os.environ.get('USER', 'root')}",
        "ProctrackType=proctrack/linuxproc",
        "TaskPlugin=task/none",
        "MpiDefault=none",
        "ReturnToService=2",
        "KillWait=2",
        f"StateSaveLocation={folder}/state",
        f"SlurmctldPidFile={folder}/slurmctld.pid",
        f"SlurmctldLogFile={folder}/slurmctld.log",
        f"SlurmdSpoolDir={folder}/spool-%n",
        f"SlurmdPidFile={folder}/slurmd-%n.pid",
        f"SlurmdLogFile={folder}/slurmd-%n.log",
        *(
            f"NodeName=n{k} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=1 RealMemory=3000"
            for k, port in enumerate(ports, 1)
        ),
        "PartitionName=all Nodes=ALL Default=YES MaxTime=60 State=UP",
    ]
    (folder / "slurm.conf").write_text("\n".join(lines) + "\n")
    (folder / "state").mkdir()
    env = os.environ | {"SLURM_CONF": str(folder / "slurm.conf")}
    munged = ["munged", "--foreground", "--force", f"--key-file={key}", f"--socket={sock}"]
    munged += [f"--{what}-file={folder}/munged.{what}" for what in ("pid", "log", "seed")]
    daemons = [munged, ["slurmctld", "-D"], *(["slurmd", "-D", "-N", f"n{k}"] for k in range(1, nodes + 1))]
    running: list[subprocess.Popen[bytes]] = []
    try:
        for command in daemons:
            log = (folder / f"{command[0]}.out").open("ab")
            running.append(subprocess.Popen(command, stdout=log, stderr=log, env=env))
            _until(lambda: sock.exists(), running, folder)
        _until(lambda: _idle(env) == nodes, running, folder)
        yield env
    finally:
        subprocess.run(["scancel", "--signal=KILL", "--full", "--user=root"], env=env, check=False)
        for one in reversed(running):
            one.terminate()
            one.wait(30)


def _idle(env: dict[str, str]) -> int:
    said = subprocess.run(["sinfo", "-h", "-N", "-o", "%t"], env=env, capture_output=True, text=True, check=False)
    return said.stdout.split().count("idle")


def _until(true, running: list[subprocess.Popen[bytes]], folder: Path, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        ended = [one.args for one in running if one.poll() is not None]
        if ended or time.monotonic() > end:
            logs = "\n".join(path.read_text(errors="replace")[-1500:] for path in folder.glob("*.log"))
            raise AssertionError(f"no cluster: {ended or 'not ready in time'}\n{logs}")
        time.sleep(0.2)
