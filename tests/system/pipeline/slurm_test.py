#!/usr/bin/env python3
"""A cohort on Slurm: one node on this machine, by its loopback address alone, with all its state in a folder of the test.
Skipped where slurm-wlm and munge are not installed or do not start."""

import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest

import cohort
from pipeline_test import STAGES, Pipeline
from running import built

PROGRAMS = ("munged", "slurmctld", "slurmd", "srun", "sinfo", "scancel", "squeue")
RUN = "srun -n1 -c$(THREADS) --mem=$(MEM)M --quiet"
CONFIGURATION = """ClusterName=local
SlurmctldHost={host}(127.0.0.1)
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.sock
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
ReturnToService=2
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
DefMemPerCPU=500
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/linux
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory=2000 State=UNKNOWN
PartitionName=main Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


class Cluster:
    """A node that is started here and ended by stop(), by the pids its programs wrote."""

    def __init__(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tunica-slurm-"))
        self.environment = dict(os.environ, SLURM_CONF=str(self.folder / "slurm.conf"))

    def program(self, *words):
        # Daemons keep the descriptors they are given: none of theirs is read to its end.
        with open(self.folder / "starting.log", "a", encoding="utf-8") as log:
            return subprocess.run(words, env=self.environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log, timeout=60,
                                  check=False).returncode == 0

    def output(self, *words):
        return subprocess.run(words, env=self.environment, capture_output=True, text=True, timeout=60, check=False).stdout

    def start(self):
        """@return why it could not be started, or None"""
        folder = self.folder
        missing = [name for name in PROGRAMS if not shutil.which(name, path=os.environ.get("PATH", "") + ":/usr/sbin")]
        if missing:
            return f"not installed: {', '.join(missing)} (slurm-wlm, munge)"
        if os.geteuid() != 0:
            return "starts only for the superuser"
        for name in ("state", "spool"):
            (folder / name).mkdir()
        (folder / "key").write_bytes(os.urandom(1024))
        (folder / "key").chmod(0o400)
        host = socket.gethostname().split(".")[0]
        (folder / "slurm.conf").write_text(CONFIGURATION.format(host=host, user="root", folder=folder, ports=free_ports(2)))
        sbin = "/usr/sbin/"
        if not self.program(sbin + "munged", "--force", f"--key-file={folder}/key", f"--socket={folder}/munge.sock",
                            f"--pid-file={folder}/munged.pid", f"--log-file={folder}/munged.log", f"--seed-file={folder}/seed"):
            return "munged does not start"
        for name, flags in (("slurmctld", ["-i"]), ("slurmd", [])):
            if not self.program(sbin + name, *flags):
                return f"{name} does not start"
        for _ in range(100):
            if "idle" in self.output("sinfo", "-h", "-o", "%T"):
                return None
            time.sleep(0.2)
        return "its node does not come up"

    def stop(self):
        if shutil.which("scancel"):
            self.program("scancel", "--user=root")
        for name in ("slurmd", "slurmctld", "munged"):
            try:
                process = int((self.folder / f"{name}.pid").read_text())
                os.kill(process, signal.SIGTERM)
                for _ in range(100):
                    os.kill(process, 0)
                    time.sleep(0.1)
            except (OSError, ValueError):
                pass  # it has ended, or never began
        shutil.rmtree(self.folder, ignore_errors=True)


@unittest.skipUnless(built(*STAGES, "phantom"), "the tools are not built")
class OnSlurm(Pipeline):
    @classmethod
    def setUpClass(cls):
        cls.cluster = Cluster()
        cls.addClassCleanup(cls.cluster.stop)
        why = cls.cluster.start()
        if why:
            raise unittest.SkipTest(f"no Slurm here: {why}")

    def arguments(self):
        return dict(CASES="cases.tsv", SHELLS=60, THREADS=1, MEM=700, RUN=RUN, **cohort.WALL,
                    environment={"SLURM_CONF": str(self.cluster.folder / "slurm.conf")})

    def results(self):
        return {path: path.stat().st_mtime_ns for path in self.out.glob("*/*/*") if path.suffix in (".ply", ".hdf", ".png")}

    def test_a_cohort_with_a_job_killed_in_the_middle(self):
        for number in range(3):
            cohort.phantom(self.folder / f"{number}.nii.gz", "sphere", 16 + number)
        table = ("case\tvolume\tlabel\tkind\tduration\tstep\np0\t0.nii.gz\t1\n"
                 "p1\t1.nii.gz\t1\tdynamic\t20ms\t2ms\np2\t2.nii.gz\t1\nbroken\tmissing.nii.gz\t1\n")
        # A long motion gives time to kill it.
        (self.folder / "cases.tsv").write_text(table.replace("20ms", "1000s"))
        arguments = dict(self.arguments(), PRESSURE="1kPa", THICKNESS="1.5mm")

        run = self.start("-j2", "-k", **arguments)
        job = None
        deadline = time.monotonic() + 120
        while job is None and time.monotonic() < deadline:
            time.sleep(0.1)
            jobs = [line.split() for line in self.cluster.output("squeue", "-h", "-o", "%i %j").splitlines()]
            if all((self.out / name / "1" / "result.hdf").exists() for name in ("p0", "p2")) and len(jobs) == 1:
                job = next((words[0] for words in jobs if words[1] == "tunica-simulate"), None)
        self.assertIsNotNone(job, "the long job was not seen")
        self.cluster.output("scancel", job)
        _, stderr = run.communicate(timeout=100)
        self.assertEqual(run.returncode, 2, stderr)
        rows = self.summary()
        self.assertEqual([rows[f"{name}/1"]["message"] for name in ("p0", "p2")], ["done"] * 2)
        self.assertEqual(rows["p1/1"]["stage"], "simulate")
        self.assertNotEqual(rows["p1/1"]["exit"], "0")
        self.assertEqual((rows["broken/1"]["stage"], rows["broken/1"]["exit"]), ("extract", "3"))
        self.assertFalse((self.out / "p1" / "1" / "result.hdf").exists())

        before = self.results()
        (self.folder / "cases.tsv").write_text(table)
        cohort.phantom(self.folder / "missing.nii.gz", "sphere", 16, seed=2)
        done = self.make("-j2", "-k", **arguments)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertEqual({row["message"] for row in self.summary().values()}, {"done"})
        after = self.results()
        self.assertEqual({path: after[path] for path in before}, before, "what was done is kept")
        self.assertEqual({path.parent.parent.name for path in set(after) - set(before)}, {"p1", "broken"})
        self.assertEqual(self.cluster.output("squeue", "-h"), "")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + ["-v"] + sys.argv[1:])
