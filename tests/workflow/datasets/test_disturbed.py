"""A cluster of processes over TCP whose parts are killed, stopped or run out of disk.

However a build is disturbed, the dataset has the bytes of an undisturbed one in the end. A stand-in
takes the place of the physics; the machinery around it, the command line included, is the real one.
"""

import os
import resource
import signal
import subprocess
import sys
import time

import pytest
from fake_blast import fake_generate, write_recipe
from stand_in import ENVIRONMENT, Cluster, start_castblast, wait_for

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="signals and limits of Linux")

#: 120 rows in shards of 10.
SIZES = {"size": 120, "shard_size": 10}
SHARDS = 12


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Bytes of dataset and card of an undisturbed build with one worker."""
    folder = tmp_path_factory.mktemp("undisturbed")
    fake_generate(write_recipe(folder / "r.yaml", **SIZES), folder / "data.nc", workers=1)
    return contents(folder)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """Two worker processes and their scheduler, for tests that leave them whole."""
    started = Cluster(tmp_path_factory.mktemp("cluster"))
    started.wait(2)
    yield started
    started.close()


def contents(folder):
    return [(folder / name).read_bytes() for name in ("data.nc", "DATASHEET.md")]


def shards(folder):
    return sorted((folder / "data.work").glob("shard-*.npz"))


def start(folder, seconds, *options, **rest):
    recipe = folder / "r.yaml"
    if not recipe.exists():
        write_recipe(recipe, **SIZES)
    return start_castblast(
        seconds, "generate", recipe, "--out", folder / "data.nc", *options, **rest
    )


def finish(process, seconds=60.0):
    """Wait for a build that ends well; returns what it said."""
    out, errors = process.communicate(timeout=seconds)
    assert process.returncode == 0, errors
    return out


def complete(folder):
    """Run the same build again, undisturbed, in this process."""
    return fake_generate(folder / "r.yaml", folder / "data.nc", workers=2)


def test_cluster_of_processes(tmp_path, undisturbed, cluster):
    out = finish(start(tmp_path, 0.05, "--scheduler", cluster.address))
    assert contents(tmp_path) == undisturbed
    assert "120 samples in " in out
    assert "samples/s, peak " in out
    assert "MB, largest worker " in out
    assert "of the workers' time: scheduling " in out


def test_workers_killed_in_mid_run(tmp_path, undisturbed):
    """SIGKILL of one of two workers, later of the other; a new one does what is left."""
    cluster = Cluster(tmp_path / "cluster")
    try:
        cluster.wait(2)
        process = start(tmp_path, 0.2, "--scheduler", cluster.address)
        wait_for(lambda: len(shards(tmp_path)) >= 2)
        cluster.workers[0].kill()
        wait_for(lambda: len(shards(tmp_path)) >= 5)
        cluster.workers[1].kill()
        cluster.add_worker()
        finish(process)
    finally:
        cluster.close()
    assert contents(tmp_path) == undisturbed


def test_coordinator_killed_a_shard_cut_and_restarted(tmp_path, undisturbed, cluster):
    """The workers still write the shards they were at when the second coordinator begins."""
    first = start(tmp_path, 0.3, "--scheduler", cluster.address)
    wait_for(lambda: len(shards(tmp_path)) >= 3)
    first.kill()
    first.wait()
    half = shards(tmp_path)[0]
    half.write_bytes(half.read_bytes()[: half.stat().st_size // 2])
    out = finish(start(tmp_path, 0.05, "--scheduler", cluster.address))
    assert "resume: " in out
    assert "1 cut shard moved aside" in out
    assert contents(tmp_path) == undisturbed


def test_scheduler_killed_and_started_again(tmp_path, undisturbed):
    """The build ends with one line instead of waiting for ever, and goes on with a new cluster."""
    cluster = Cluster(tmp_path / "cluster")
    try:
        cluster.wait(2)
        process = start(tmp_path, 0.2, "--scheduler", cluster.address)
        wait_for(lambda: len(shards(tmp_path)) >= 3)
        cluster.scheduler.kill()
        _, errors = process.communicate(timeout=60)
    finally:
        cluster.close()
    assert process.returncode == 2, errors
    assert "error: the scheduler went away" in errors
    assert "Traceback" not in errors
    assert complete(tmp_path).lines[0].startswith("resume: ")
    assert contents(tmp_path) == undisturbed


def test_interrupt_ends_at_once(tmp_path, undisturbed):
    """Ctrl-C while shards of a minute are under way: a second or two, one line, code 130."""
    process = start(tmp_path, 60.0, "--workers", 2)
    for line in process.stderr:
        if "drawing the design" in line:
            break
    time.sleep(3.0)
    assert process.poll() is None
    begin = time.monotonic()
    process.send_signal(signal.SIGINT)
    out, errors = process.communicate(timeout=30)
    assert time.monotonic() - begin < 4.0
    assert process.returncode == 130
    assert errors.splitlines() == ["stopped; run the same command again to resume"]
    assert out == ""
    complete(tmp_path)
    assert contents(tmp_path) == undisturbed


def test_interrupt_over_a_cluster(tmp_path, undisturbed, cluster):
    # Shards of two seconds: on a busy machine the build must not be over before it is stopped.
    process = start(tmp_path, 2.0, "--scheduler", cluster.address)
    wait_for(lambda: len(shards(tmp_path)) >= 2)
    begin = time.monotonic()
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert time.monotonic() - begin < 5.0
    assert process.returncode == 130
    assert errors.splitlines()[-1] == "stopped; run the same command again to resume"
    complete(tmp_path)
    assert contents(tmp_path) == undisturbed


@pytest.fixture
def small_disk(tmp_path):
    """A disk of 200 kB, where one may be mounted."""
    folder = tmp_path / "disk"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=200k", "none", str(folder)]
    try:
        done = subprocess.run(command, capture_output=True, check=False)
    except FileNotFoundError:
        pytest.skip("mount is not there")
    if done.returncode:
        pytest.skip("mounting needs rights")
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


@pytest.mark.parametrize("left", [20_000, 120_000])
def test_full_disk(small_disk, undisturbed, left):
    """Full during the shards, or when only the final file does not fit any more.

    A file that fills the disk is in the way; once it is gone the same command goes on.
    """
    ballast = small_disk / "ballast"
    ballast.write_bytes(bytes(200 * 1024 - left - 8192))
    process = start(small_disk, 0.0, "--workers", 2)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 2, errors
    assert len([line for line in errors.splitlines() if line.startswith("error: ")]) == 1
    assert "cannot be written" in errors
    assert "Traceback" not in errors
    assert not (small_disk / "data.nc").exists()
    ballast.unlink()
    subprocess.run(["mount", "-o", "remount,size=2m", str(small_disk)], check=True)
    complete(small_disk)
    assert contents(small_disk) == undisturbed


def test_files_that_may_not_grow(tmp_path, undisturbed):
    """A limit on the size of files stands in for the full disk where none can be mounted."""

    def bounded():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))

    write_recipe(tmp_path / "r.yaml", **SIZES)
    process = start(tmp_path, 0.0, "--workers", 2, preexec_fn=bounded)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 2, errors
    assert len([line for line in errors.splitlines() if line.startswith("error: ")]) == 1
    assert "cannot be written" in errors
    assert "Traceback" not in errors
    assert not (tmp_path / "data.nc").exists()
    assert not list(tmp_path.rglob("*.tmp.*"))
    complete(tmp_path)
    assert contents(tmp_path) == undisturbed


def test_other_sizes_of_shards_go_on_and_give_the_same_rows(tmp_path, undisturbed):
    """How rows are cut into shards is no part of what they are: old shards count."""
    from castblast.dataset.file.store import open_dataset

    process = start(tmp_path, 0.3, "--workers", 1)
    wait_for(lambda: len(shards(tmp_path)) >= 3)
    process.kill()
    process.wait()
    done = len(shards(tmp_path))
    write_recipe(tmp_path / "r.yaml", **{**SIZES, "shard_size": 7})
    todo = -(-(120 - 10 * done) // 7)
    told = complete(tmp_path).lines[0]
    assert told == f"resume: {done} of {done + todo} shards valid, {todo} to do"
    reference = tmp_path / "reference.nc"
    reference.write_bytes(undisturbed[0])
    hashes = [open_dataset(p).attrs["content_sha256"] for p in (tmp_path / "data.nc", reference)]
    assert hashes[0] == hashes[1]


def test_stand_in_runs_the_real_command_line():
    done = subprocess.run(
        [sys.executable, os.fspath(__import__("stand_in").__file__), "0", "--version"],
        capture_output=True, text=True, check=True, env=ENVIRONMENT,
    )  # fmt: skip
    assert done.stdout.startswith("castblast ")
