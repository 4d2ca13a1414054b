"""Start and stop a SLURM of one node for tests: munge, controller and daemon in one folder."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

DAEMONS = ("munged", "slurmctld", "slurmd")
CONFIGURATION = """\
ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
AuthType=auth/munge
AuthInfo=socket={folder}/munge/socket
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SlurmdParameters=config_overrides
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=sched_interval=1,batch_sched_delay=0
ReturnToService=2
MpiDefault=none
KillWait=5
MinJobAge=10000
NodeName={host} NodeAddr=127.0.0.1 CPUs=8 RealMemory=16000 State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


def reason_to_skip() -> str | None:
    """Return the reason why SLURM cannot be started, or None."""
    missing = [name for name in DAEMONS if shutil.which(name, path="/usr/sbin:/usr/bin") is None]
    if missing:
        return f"{', '.join(missing)} not installed (apt-get install slurm-wlm)"
    return None if os.geteuid() == 0 else "only root can start the daemons of SLURM"


def _ports() -> list[int]:
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(2)]
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports


class Slurm:
    """The daemons of a SLURM, and its commands."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in ("munge", "state", "spool"):
            (folder / name).mkdir()
        host = socket.gethostname().partition(".")[0]
        (folder / "slurm.conf").write_text(CONFIGURATION.format(host=host, folder=folder, ports=_ports()))
        (folder / "cgroup.conf").write_text("CgroupPlugin=cgroup/v1\n")
        self.environment = {**os.environ, "SLURM_CONF": str(folder / "slurm.conf")}

    def start(self) -> None:
        munge, conf = self.folder / "munge", str(self.folder / "slurm.conf")
        (munge / "key").write_bytes(os.urandom(1024))
        (munge / "key").chmod(0o400)
        munge.chmod(0o711)
        places = {"key-file": "key", "socket": "socket", "pid-file": "pid", "log-file": "log", "seed-file": "seed"}
        options = [f"--{name}={munge / file}" for name, file in places.items()]
        self._daemon("munged", "--force", "--num-threads=1", *options)
        self._daemon("slurmctld", "-f", conf)
        self._daemon("slurmd", "-f", conf)
        self._until(lambda: "idle" in self.call("sinfo", "-h", "-o", "%T"), 300)

    def stop(self) -> None:
        for file in ("slurmd.pid", "slurmctld.pid", "munge/pid"):
            if (self.folder / file).exists():
                os.kill(int((self.folder / file).read_text()), signal.SIGKILL)

    def _daemon(self, name: str, *arguments: str) -> None:
        path = shutil.which(name, path="/usr/sbin:/usr/bin")
        subprocess.run([path, *arguments], check=True, env=self.environment, timeout=300, capture_output=True)

    def call(self, *command: str) -> str:
        done = subprocess.run(command, env=self.environment, timeout=300, capture_output=True, text=True, check=False)
        return done.stdout

    def _until(self, true, seconds: float) -> None:
        deadline = time.monotonic() + seconds
        while not true():
            assert time.monotonic() < deadline, (self.folder / "slurmctld.log").read_text()[-2000:]
            time.sleep(0.2)

    def submit(self, *arguments: str) -> str:
        return self.call("sbatch", "--parsable", *arguments).strip()

    def wait(self, job: str, seconds: float = 240) -> set[str]:
        """Wait for a job or an array of jobs; return their final states."""
        self._until(
            lambda: not self.call("squeue", "-h", "-t", "PENDING,RUNNING,COMPLETING", "-j", job).strip(), seconds
        )
        text = self.call("scontrol", "show", "job", job)
        return {word.partition("=")[2] for word in text.split() if word.startswith("JobState=")}


@contextmanager
def running() -> Iterator[Slurm]:
    """Start a SLURM and stop it in the end; its folder has a short name, because paths of sockets are limited."""
    with tempfile.TemporaryDirectory(prefix="slurm-", ignore_cleanup_errors=True) as folder:
        found = Slurm(Path(folder))
        try:
            found.start()
            yield found
        finally:
            found.stop()
