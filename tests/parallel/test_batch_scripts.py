"""The batch scripts, with commands of the batch systems replaced: they run a case, are put back, and go on."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pbem.results.reader import open_results
from tests.cli.cli_sample import BLOCKS
from tests.parallel.launch import TIMEOUT, make_environment

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
BATCH_SCRIPTS = sorted([*SCRIPTS.glob("slurm/*.sh"), *SCRIPTS.glob("pbs/*.sh")])

COMMANDS = {
    "pbem": f'exec "{sys.executable}" -m pbem "$@"',
    # Its own options left out; a task has the variables of its step.
    "srun": 'while [[ $1 == --* ]]; do shift; done\nexport SLURM_STEP_ID=0 SLURM_STEP_NUM_TASKS=2\n'
            'exec mpirun -n 2 "$@"',
    "scontrol": 'echo "$@" >>scontrol.log',
    "sbatch": 'echo "CHAIN=$CHAIN $*" >>sbatch.log\nwc -l <sbatch.log',
}


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """The environment of a job's script; the case is in the working directory."""
    (tmp_path / "blocks.toml").write_text(BLOCKS)
    (tmp_path / "nodes").write_text("node1\nnode1\n")
    commands = tmp_path / "bin"
    commands.mkdir()
    for name, text in COMMANDS.items():
        (commands / name).write_text(f"#!/usr/bin/env bash\n{text}\n")
        (commands / name).chmod(0o755)
    job = {"SLURM_JOB_ID": "7", "SLURM_NTASKS": "2", "SLURM_PROCID": "0", "PBS_NODEFILE": str(tmp_path / "nodes"),
           "PBS_O_WORKDIR": str(tmp_path)}
    root = str(SCRIPTS.parent)
    return make_environment() | job | {"PATH": f"{commands}:{os.environ['PATH']}", "PYTHONPATH": root}


def run_script(script: str, *args: str, folder: Path, environment: dict[str, str]) -> subprocess.CompletedProcess[str]:
    command = ["bash", str(SCRIPTS / script), *args]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=TIMEOUT)


@pytest.mark.parametrize("script", BATCH_SCRIPTS, ids=lambda script: f"{script.parent.name}/{script.name}")
def test_scripts_are_sound(script: Path) -> None:
    assert subprocess.run(["bash", "-n", script], capture_output=True).stderr == b""
    if shutil.which("shellcheck"):
        done = subprocess.run(["shellcheck", script], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("script", ["slurm/crack_field.sh", "pbs/crack_field.sh"])
def test_a_job_runs_and_a_later_one_goes_on(script: str, tmp_path: Path, environment: dict[str, str]) -> None:
    arguments = ("blocks.toml",) if script.startswith("slurm") else ()
    environment = environment | {"CASE": "blocks.toml"}
    done = run_script(script, *arguments, folder=tmp_path, environment=environment)
    assert done.returncode == 0, done.stderr
    assert open_results(tmp_path / "blocks.h5").ranks == 2
    assert "finished: 3 steps" in done.stdout
    done = run_script(script, *arguments, folder=tmp_path, environment=environment)
    assert done.returncode == 0, done.stderr
    assert "step 1 of 3" not in done.stdout and "finished: 3 steps" in done.stdout


def test_a_big_field_is_made_at_the_first_start(tmp_path: Path, environment: dict[str, str]) -> None:
    done = run_script("slurm/crack_field.sh", folder=tmp_path, environment=environment | {"CRACKS": "3"})
    assert done.returncode == 0, done.stderr
    assert len(open_results(tmp_path / "crack_field.h5").contact) == 3


def test_a_job_whose_time_runs_out_is_put_back(tmp_path: Path, environment: dict[str, str]) -> None:
    command = ["bash", str(SCRIPTS / "slurm/crack_field.sh"), "blocks.toml"]
    # In place of the ranks something that lasts.
    (tmp_path / "bin" / "srun").write_text("#!/usr/bin/env bash\ntouch started\nexec sleep 100\n")
    with subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True) as job:
        while not (tmp_path / "started").exists():
            time.sleep(0.05)
        job.send_signal(signal.SIGUSR1)
        out, _ = job.communicate(timeout=TIMEOUT)
    assert job.returncode == 0 and "time runs out" in out
    assert (tmp_path / "scontrol.log").read_text() == "requeue 7\n"


def test_a_chain_of_jobs_waits_for_one_another(tmp_path: Path, environment: dict[str, str]) -> None:
    done = run_script("slurm/chain.sh", "3", "blocks.toml", folder=tmp_path, environment=environment)
    assert done.returncode == 0, done.stderr
    jobs = (tmp_path / "sbatch.log").read_text().splitlines()
    assert [job.partition("--dependency=")[2].split(" ")[0] for job in jobs] == ["", "afterany:1", "afterany:2"]
    assert all(job.startswith("CHAIN=1 ") and job.endswith("crack_field.sh blocks.toml") for job in jobs)
    assert run_script("slurm/chain.sh", folder=tmp_path, environment=environment).returncode == 2
