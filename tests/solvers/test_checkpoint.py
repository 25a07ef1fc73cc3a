"""Checkpoints within one process: what is kept, what is refused, and marches and sweeps that go on from them."""

import errno
import signal

import h5py
import numpy as np
import pytest

from tests.conftest import COMPLEX
from uplift.meshes.checked import ModelError
from uplift.solvers import watch as watching
from uplift.solvers.bases.krylov import krylov_basis
from uplift.solvers.bases.project import project
from uplift.solvers.bases.settings import KrylovSettings
from uplift.solvers.checkpoint import Checkpoint, RowOrder, read_file, write_file
from uplift.solvers.errors import Stopped
from uplift.solvers.frequency_domain.harmonic import harmonic_sweep
from uplift.solvers.time_domain.dense_stepper import DenseStepper
from uplift.solvers.time_domain.initial import static_state
from uplift.solvers.time_domain.march import stepper_of, transient
from uplift.solvers.time_domain.scheme import Scheme
from uplift.solvers.watch import Watch

pytestmark = pytest.mark.both

STEPS, STEP = 300, 0.01


@pytest.fixture
def shared_path(tmp_path, comm):
    """A folder that all ranks know."""
    return comm.bcast(tmp_path)


def same(here, there, *, bits):
    """Whether two arrays are equal, to the last bit where one rank has the whole factor.

    Where ranks share one, MUMPS adds in the order in which messages come, and two runs without any break differ as well.
    """
    return np.array_equal(here, there) if bits else np.max(np.abs(here - there)) <= 1e-10 * np.max(np.abs(here))


def stopped_at(moments, run, folder, assembly, monkeypatch):
    """Call `run(watch)` again and again, stopped by a signal at each of the moments in turn; return what the last one returns."""
    monkeypatch.setattr(watching, "MEETING", 0.0)  # the ranks meet at every step
    comm, labels = assembly.operators.comm, assembly.plate.labels
    for number, moment in enumerate(moments):
        watch = Watch(checkpoint=Checkpoint(folder, "this run", comm, labels, seconds=1e9, resume=number > 0))

        def stop(what, done, total, watch=watch, moment=moment):
            if done >= moment:
                watch.signal = signal.SIGTERM

        watch.progress = stop
        with pytest.raises(Stopped, match=r"terminated at \d+ of "):
            run(watch)
    return run(Watch(checkpoint=Checkpoint(folder, "this run", comm, labels, seconds=1e9, resume=True)))


@pytest.mark.ranks(2, 3)
@pytest.mark.parametrize("in_basis", [False, True])
def test_a_march_that_is_stopped_again_and_again_ends_in_the_same_bits(assembly, shared_path, comm, monkeypatch, in_basis):
    times = 10 if comm.size == 1 else 2
    monkeypatch.setattr(DenseStepper, "block", 4)  # the ranks meet between blocks
    moments = sorted(np.random.default_rng(1).choice(np.arange(2, STEPS - 4), times, replace=False).tolist())
    operators = assembly.operators
    model = project(operators, krylov_basis(operators, KrylovSettings(tolerance=1e-6))) if in_basis else operators

    class Middle:
        """Looks at something that is spread over the ranks."""

        def __init__(self):
            self.partial = np.full(STEPS // 2 + 1, np.nan)

        def wants(self, row):
            return row % 3 == 0

        def watch(self, row, values):
            self.partial[row] = values[::7].sum()

        def kept(self):
            return self.partial[None], np.zeros((assembly.operators.n_local, 0))

        def restore(self, shares, fields):
            self.partial[:] = shares[0]

    middles = []

    def run(watch):
        with static_state(model, exact_uplift=True) as start, stepper_of(model, Scheme(), STEP, exact_uplift=True) as method:
            middles.append(Middle())
            history = transient(method, start, STEPS, every=2, energy=True, watcher=middles[-1], watch=watch)
            return history, method.contacts.problem.tries

    whole, tries = run(None)
    broken, tries_too = stopped_at(moments, run, shared_path / "march", assembly, monkeypatch)
    assert tries == tries_too and whole.peak == broken.peak
    for name in ("probes", "elongation", "release", "reactions", "peak_field"):
        assert same(getattr(whole, name), getattr(broken, name), bits=comm.size == 1), name
    for name in ("kinetic", "strain", "springs", "damped", "work"):
        assert same(getattr(whole.ledger, name), getattr(broken.ledger, name), bits=comm.size == 1), name
    noted = ~np.isnan(middles[0].partial)
    assert np.array_equal(noted, ~np.isnan(middles[-1].partial))
    assert same(middles[0].partial[noted], middles[-1].partial[noted], bits=comm.size == 1)


@pytest.mark.skipif(not COMPLEX, reason="the sweep needs the complex build")
@pytest.mark.ranks(2, 3)
def test_a_sweep_that_is_stopped_ends_in_the_same_bits(assembly, shared_path, comm, monkeypatch):
    omega = 2 * np.pi * np.linspace(0, 25, 40)
    for groups in range(1, comm.size + 1):
        whole = harmonic_sweep(assembly.operators, omega, groups=groups)
        moments = [m for m in range(1, len(omega) - 2 * groups) if m % groups == 0][3::7]

        def run(watch, groups=groups):
            return harmonic_sweep(assembly.operators, omega, groups=groups, watch=watch)

        broken = stopped_at(moments, run, shared_path / f"sweep{groups}", assembly, monkeypatch)
        for name in ("outputs", "fields"):
            assert same(getattr(whole, name), getattr(broken, name), bits=groups == comm.size), (groups, name)


@pytest.mark.ranks(2, 3)
def test_rows_have_an_order_that_knows_no_ranks(assembly, comm):
    labels = assembly.plate.labels
    everyone = np.concatenate(comm.allgather(labels))
    order = RowOrder(comm, labels)
    whole = order.gather(labels)
    if comm.rank == 0:
        assert np.array_equal(whole, everyone[np.lexsort(everyone.T[::-1])])
    assert np.array_equal(order.scatter(whole, (5,), np.int64), labels)
    # The vertical displacement of all nodes under a rigid translation is 1, and so is that of the joints' ends: by place.
    assert len({tuple(row) for row in everyone}) == assembly.operators.n
    with pytest.raises(RuntimeError, match="same label") if comm.rank == 0 and assembly.operators.n > 1 and comm.size == 1 else no_error():
        if comm.size == 1:
            RowOrder(comm, np.zeros_like(labels))


class no_error:  # noqa: N801 - stands where a context manager of pytest does
    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None


def test_files_that_are_not_this_run_s_are_refused_by_name(tmp_path):
    path, arrays = tmp_path / "march-1.h5", {"step": np.array(3), "u": np.linspace(0, 1, 1000)}
    write_file(path, arrays, "run", "rows")
    again = read_file(path, "run", "rows")
    assert again.keys() == arrays.keys() and np.array_equal(again["u"], arrays["u"]) and again["step"] == 3
    whole = path.read_bytes()
    for identity, rows, words in (("other", "rows", "another scene or another method"), ("run", "other", "another mesh")):
        with pytest.raises(ModelError, match=f"--resume: {path} is a checkpoint of {words}"):
            read_file(path, identity, rows)
    for length in (0, 100, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(ModelError, match=f"{path} is truncated"):
            read_file(path, "run", "rows")
    place = whole.index(arrays["u"][500:503].tobytes())
    path.write_bytes(whole[:place] + b"\x01" + whole[place + 1 :])
    with pytest.raises(ModelError, match=f"{path} is damaged"):
        read_file(path, "run", "rows")
    with h5py.File(path, "w") as foreign:
        foreign["u"] = arrays["u"]
    with pytest.raises(ModelError, match=f"{path} is not a checkpoint of this program"):
        read_file(path, "run", "rows")


def test_a_full_disk_is_reported_and_the_checkpoint_before_it_stays(tmp_path, comm, caplog, monkeypatch):
    checkpoint = Checkpoint(tmp_path / "new", "run", comm, np.arange(4)[:, None])
    assert checkpoint.save("march-1", {"u": np.zeros(10)})
    (tmp_path / "new" / "march-1.unfinished").write_text("of a run that was killed", encoding="utf-8")
    with caplog.at_level("WARNING", logger="uplift"), monkeypatch.context() as full:
        full.setattr("os.fsync", lambda handle: (_ for _ in ()).throw(OSError(errno.ENOSPC, "No space left on device")))
        assert not checkpoint.save("march-1", {"u": np.ones(10)})
    assert "march-1.h5 could not be written" in caplog.text and "No space left on device" in caplog.text
    words = checkpoint.state_in_words(comm)
    assert "No space left" in words and "the checkpoint before it can be resumed" in words
    kept = Checkpoint(tmp_path / "new", "run", comm, np.arange(4)[:, None], resume=True).load("march-1")
    assert np.array_equal(kept["u"], np.zeros(10))
    assert checkpoint.save("march-1", {"u": np.ones(10)})
    assert checkpoint.state_in_words(comm) == f"checkpoint in {tmp_path / 'new'}; go on with --resume"


def test_a_kill_between_writing_and_renaming_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "march-1.h5"
    write_file(path, {"u": np.zeros(3)}, "run", "rows")

    def killed(*_):
        raise OSError(errno.EIO, "killed")

    monkeypatch.setattr("uplift.solvers.checkpoint.os.fsync", killed)
    with pytest.raises(OSError, match="killed"):
        write_file(path, {"u": np.ones(3)}, "run", "rows")
    assert np.array_equal(read_file(path, "run", "rows")["u"], np.zeros(3))
    assert [p.name for p in tmp_path.iterdir()] == ["march-1.h5"]


def test_a_new_run_does_not_take_what_an_old_one_left(tmp_path, comm, caplog):
    labels = np.arange(4)[:, None]
    old = Checkpoint(tmp_path, "run", comm, labels)
    assert old.save("laplace-1-0001", {"a": np.zeros(1)}) and old.save("laplace-1-0002", {"a": np.zeros(1)})
    with caplog.at_level("WARNING", logger="solvers"):
        new = Checkpoint(tmp_path, "run", comm, labels)
    assert "--resume would go on from them" in caplog.text
    assert new.load("laplace-1-0001") is None
    new.save("laplace-1-0001", {"a": np.ones(1)})
    assert [p.name for p in tmp_path.iterdir()] == ["laplace-1-0001.h5"]
    new.clear()
    assert not tmp_path.exists()


def test_only_checkpoints_are_removed_and_through_no_link(tmp_path, comm):
    folder, elsewhere = tmp_path / "checkpoint", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.mkdir()
    labels = np.arange(3)[:, None]
    write_file(elsewhere / "theirs.h5", {"a": np.ones(2)}, "run", "rows")
    (folder / "linked.h5").symlink_to(elsewhere / "theirs.h5")
    with h5py.File(folder / "mine.h5", "w") as foreign:
        foreign["x"] = np.ones(3)
    (folder / "text.h5").write_text("no", encoding="utf-8")
    (folder / "march.unfinished").symlink_to(elsewhere / "theirs.h5")
    before = (elsewhere / "theirs.h5").read_bytes()
    checkpoint = Checkpoint(folder, "run", comm, labels)
    assert checkpoint.save("march", {"a": np.ones(3)})
    assert checkpoint.save("march", {"a": np.zeros(3)})
    checkpoint.clear()
    assert sorted(path.name for path in folder.iterdir()) == ["linked.h5", "mine.h5", "text.h5"]
    assert (elsewhere / "theirs.h5").read_bytes() == before
    (tmp_path / "link").symlink_to(elsewhere)
    with pytest.raises(ModelError, match="is a link"):
        Checkpoint(tmp_path / "link", "run", comm, labels)


def test_a_checkpoint_that_says_more_than_it_holds_is_refused(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs.update({"format": "uplift checkpoint 1", "run": "r", "rows": "r", "contents": "0"})
        file.create_dataset("a", (10**6, 10**6), dtype=float, chunks=(1000, 1000))
    with pytest.raises(ModelError, match="no values"):
        read_file(tmp_path / "a.h5", "r", "r")
