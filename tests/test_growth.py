"""What becomes of a store when its campaign changes."""

import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import planted
import pytest
import toy
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from test_execute import digests, run, values

from mdr_dask import execute, store
from mdr_dask.campaign import Replication, Tolerance, load
from mdr_dask.errors import StoreError
from mdr_dask.execute import Progress, Resources
from mdr_dask.execute.stages import stored_layout
from mdr_dask.models.base import Status
from mdr_dask.refinement import Stage


def test_values_in_the_middle_of_zipped_axes_are_appended_and_found(toy, url):
    def zipped(*points):
        positions, slopes = zip(*points, strict=True)
        return toy.campaign(toy.axis("position", positions, "case"), toy.axis("slope", slopes, "case"))

    run(zipped((1.0, 2.0), (3.0, 4.0)), url)
    before = values(url)
    toy.COMPUTED.clear()
    assert run(zipped((1.0, 2.0), (2.0, 7.0), (3.0, 4.0)), url).done == 6
    after = values(url)
    assert after.position.to_numpy().tolist() == [1.0, 3.0, 2.0]
    assert after.slope.to_numpy().tolist() == [2.0, 4.0, 7.0]
    np.testing.assert_array_equal(after[:2], before)


def test_named_values_grow_and_those_left_out_stay(toy, url):
    def named(*entries):
        axis = toy.axis("position", [value for _, value in entries])
        return toy.campaign(replace(axis, labels=tuple(name for name, _ in entries), unit=None))

    run(named(("near", 1.0), ("far", 9.0)), url)
    before = values(url)
    assert run(named(("middle", 4.0), ("far", 9.0)), url).done == 6
    after = values(url)
    assert after.position.to_numpy().tolist() == ["near", "far", "middle"]
    np.testing.assert_array_equal(after[:2], before)
    numbers = toy.campaign(toy.axis("position", [1.0, 2.5]))
    assert run(numbers, url).done == 6
    assert values(url).position.to_numpy().tolist() == ["near", "far", "middle", "2.5"]


def test_fewer_values_and_realisations_keep_what_is_there_and_run_only_what_is_asked(toy, url):
    campaign = replace(toy.campaign(toy.axis("position", [1.0, 2.0, 3.0])), blocks={"position": 1, "realisation": 1})

    def interrupt(progress: Progress) -> None:
        if progress.done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        execute.run(campaign, url, Resources(threads=1), interrupt)
    toy.COMPUTED.clear()
    fewer = toy.campaign(toy.axis("position", [3.0, 2.0]), realisations=Replication(2, 2, {}))
    progress = run(fewer, url)
    assert progress.total == 4
    assert set(toy.COMPUTED) <= {(position, number) for position in (2.0, 3.0) for number in (0, 1)}
    status = store.datasets(url)[""].status
    assert (status.sel(position=[2.0, 3.0], realisation=[0, 1]) == Status.DONE).all()
    assert status.sizes == {"position": 3, "realisation": 6}
    assert (status != Status.NOT_NEEDED).all()


def test_fewer_outputs_go_on_with_the_stored_ones_and_more_are_refused(toy, url):
    both = toy.campaign(toy.axis("position", [1.0]), outputs=("height", "trace"))
    run(both, url)
    fewer = toy.campaign(toy.axis("position", [1.0, 2.0]))
    assert run(fewer, url).done == 6
    assert np.isfinite(values(url, "trace")).all()
    run(fewer, url + "2")
    with pytest.raises(StoreError, match="outputs: the store lacks trace"):
        run(both, url + "2")


def test_a_study_with_series_and_a_study_without_need_stores_of_their_own(toy, url):
    plain = toy.campaign(toy.axis("position", [1.0]))
    series = replace(plain, series=(replace(plain.series[0], name="near"),))
    run(plain, url)
    before = digests(url)
    with pytest.raises(StoreError, match="series: none in the store, near in the campaign"):
        run(series, url)
    assert digests(url) == before
    run(series, url + "2")
    with pytest.raises(StoreError, match="series: near in the store, none in the campaign"):
        run(plain, url + "2")


def test_another_campaign_takes_the_place_of_one_that_was_never_laid_out(toy, url, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr("mdr_dask.store.layout._series_attributes", lambda _: 1 / 0)
        with pytest.raises(ZeroDivisionError, match="division by zero"):
            run(replace(toy.campaign(toy.axis("position", [1.0, 2.0])), blocks={"realisation": 1}), url)
    with pytest.raises(StoreError, match="still empty"):
        store.datasets(url)
    assert run(replace(toy.campaign(toy.axis("slope", [1.0, 2.0])), blocks={"realisation": 4}), url).done == 12
    assert np.isfinite(values(url)).all()


def test_a_study_that_was_moved_with_its_files_is_the_same_study(tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    planted.make_tables(first)
    (first / "line 2.csv").write_text((first / "line.csv").read_text() + "20,0\n")
    lines = "  surface: [{profile: line.csv}, {profile: line 2.csv}]\n  normal_force: 1 N\n  velocity: 1 mm/s\n"
    rubber = "  material: {dma_table: {file: dma.csv, poisson_ratio: 0.5}}\n"
    planted.make(first, f"model: sliding_friction\nparameters:\n{lines}{rubber}", realisations=1)
    shutil.move(first, second)
    layout, _ = stored_layout(Stage.first(load(second / "study.yaml")), str(second / "study.zarr"))
    assert store.is_laid_out(str(second / "study.zarr"), layout)
    assert str(second) in repr(layout)
    assert str(first) not in repr(layout)


def test_files_and_folders_that_are_no_store_are_left_alone(toy, tmp_path):
    campaign = toy.campaign(toy.axis("position", [1.0]))
    (tmp_path / "file").write_text("mine")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder/notes.txt").write_text("mine")
    with pytest.raises(StoreError, match="a file, expected the folder of a store"):
        run(campaign, str(tmp_path / "file"))
    with pytest.raises(StoreError, match=r"a folder with other files \(notes\.txt\)"):
        run(campaign, str(tmp_path / "folder"))
    assert [path.name for path in (tmp_path / "folder").iterdir()] == ["notes.txt"]


def test_leftovers_of_a_killed_write_are_not_read_and_removed_by_the_next_run(toy, url):
    campaign = toy.campaign(toy.axis("position", [1.0]))
    run(campaign, url)
    before = digests(url)
    leftovers = [Path(url, name) for name in ("status/records/0.0-1.0123abcd.partial", "height/c/0/0.4567cdef.partial")]
    for leftover in leftovers:
        leftover.write_text("{")
    assert len(list(store.records(url, ""))) == 1
    assert run(campaign, url, retry_failed=True).kept == 6
    assert digests(url) == before
    assert not any(leftover.exists() for leftover in leftovers)


POSITIONS = (1.0, 2.0, 3.0, 4.0)
NOISES = (0.01, 0.2, 0.4)


SOME = {
    "positions": st.lists(st.sampled_from(POSITIONS), min_size=1, unique=True),
    "noises": st.lists(st.sampled_from(NOISES), min_size=1, unique=True),
}


class StoreAgainstDict(RuleBasedStateMachine):
    """Any sequence of runs, of whatever is asked for, with interruptions, against what a dict would hold."""

    def __init__(self) -> None:
        super().__init__()
        self.patch = pytest.MonkeyPatch()
        self.toy = toy
        toy.register(self.patch)
        self.folder = Path(tempfile.mkdtemp())
        self.url = str(self.folder / "study.zarr")
        self.expected: set[tuple[float, float, int]] = set()
        self.possible: set[tuple[float, float, int]] = set()

    def teardown(self) -> None:
        self.patch.undo()
        shutil.rmtree(self.folder)

    @initialize(position=st.integers(1, 3), realisation=st.integers(1, 3), noise=st.integers(1, 3))
    def cut(self, **lengths: int) -> None:
        self.blocks = lengths

    def campaign(self, positions, noises, replication):
        axes = self.toy.axis("position", positions), self.toy.axis("noise", noises)
        campaign = self.toy.campaign(*axes, realisations=replication, fail_above=3.5)
        return replace(campaign, blocks=self.blocks)

    def ask(self, positions, noises, count) -> set[tuple[float, float, int]]:
        return {(p, n, r) for p in positions for n in noises for r in range(count)}

    @rule(**SOME, count=st.integers(1, 5), retry=st.booleans())
    def finish(self, positions, noises, count, retry) -> None:
        asked = self.ask(positions, noises, count)
        progress = run(self.campaign(positions, noises, Replication(count, count, {})), self.url, retry_failed=retry)
        failing = {cell for cell in asked if cell[0] > 3.5}
        assert progress.total == len(asked)
        assert progress.kept >= len(self.expected & asked - failing)
        self.expected |= asked
        self.possible |= asked

    @rule(**SOME, count=st.integers(2, 5), blocks=st.integers(1, 4))
    def interrupt(self, positions, noises, count, blocks) -> None:
        def stop(progress: Progress) -> None:
            if progress.blocks >= blocks:
                raise KeyboardInterrupt

        campaign = self.campaign(positions, noises, Replication(count, count, {}))
        try:
            execute.run(campaign, self.url, Resources(threads=1), stop)
        except KeyboardInterrupt:
            self.possible |= self.ask(positions, noises, count)
        else:
            self.expected |= self.ask(positions, noises, count)
            self.possible |= self.expected

    @rule(**SOME, tolerance=st.sampled_from([0.02, 0.1, 0.3]))
    def adapt(self, positions, noises, tolerance) -> None:
        until = {"height": Tolerance(relative=tolerance)}
        run(self.campaign(positions, noises, Replication(2, 6, until)), self.url)
        self.expected |= self.ask(positions, noises, 2)
        self.possible |= self.ask(positions, noises, 6)

    @invariant()
    def holds_what_a_dict_would(self) -> None:
        if not Path(self.url, "zarr.json").exists() or not self.possible:
            return
        dataset = store.datasets(self.url)[""].load()
        height, status = dataset.height.to_numpy(), dataset.status.to_numpy()
        for (i, position), (j, noise) in (
            (p, n) for p in enumerate(dataset.position.to_numpy()) for n in enumerate(dataset.noise.to_numpy())
        ):
            for r in range(dataset.sizes["realisation"]):
                cell = (float(position), float(noise), r)
                state = status[i, j, r]
                settled = Status.FAILED if position > 3.5 else Status.DONE
                if cell in self.expected:
                    assert state == settled
                else:
                    assert state in (Status.MISSING, Status.NOT_NEEDED, settled)
                    assert cell in self.possible or state == Status.MISSING
                assert np.isfinite(height[i, j, r]) == (state == Status.DONE)
                if state == Status.DONE:
                    draw = np.random.Generator(np.random.Philox(np.random.SeedSequence(1, spawn_key=(r,))))
                    assert height[i, j, r] == 2.0 * position + noise * draw.standard_normal() * position


StoreAgainstDict.TestCase.settings = settings(
    max_examples=12, stateful_step_count=8, deadline=None, suppress_health_check=list(HealthCheck)
)
TestStoreAgainstDict = pytest.mark.slow(StoreAgainstDict.TestCase)
