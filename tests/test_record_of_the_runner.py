"""Record of plans, stores as they are laid out, tasks, rounds and clusters: all counts and all words."""

import json
import re
import sys
from dataclasses import asdict, fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
import record
from distributed.deploy import Cluster

from mdr_dask import bootstrap, execute, plan, replication, store, task
from mdr_dask.campaign import Replication, Tolerance, definition, document, expand, loads, measured, spec, variation
from mdr_dask.errors import MdrDaskError
from mdr_dask.execute import Event, Part, Resources, cells, clusters, crew, events, executors, rounds
from mdr_dask.execute.progress import Progress
from mdr_dask.models.base import Status
from mdr_dask.store import (
    copies,
    digests,
    expected,
    files,
    layout,
    ledgers,
    locks,
    reading,
    runners,
    seals,
    sound,
    verifying,
)
from mdr_dask.store.locks import Hold

MASKED = {"history", "created", "host", "python", "versions", "source"}


def said(act, *given):
    """Return what comes of an act, or why nothing does."""
    try:
        return act(*given)
    except (MdrDaskError, ValueError) as error:
        return f"{type(error).__name__}: {error}"


def short(*numbers):
    """Return numbers of unequal size, none of which hides another."""
    return [f"{number:.6g}" for number in numbers]


def cost(toy, monkeypatch, seconds, **changes):
    each = {"seconds": lambda block: seconds(block) * block.cases * len(block.realisations)}
    model = replace(toy.MODEL, **(each | changes))
    monkeypatch.setattr(sys.modules["mdr_dask.models.toy"], "MODEL", model)


ROUNDS = Replication(12, 90, {"height": Tolerance(relative=0.01)})
COSTS = {
    "cheap": (lambda block: 1e-6, {}),
    "usual": (lambda block: 7e-3, {}),
    "dear": (lambda block: 0.9, {}),
    "rising": (lambda block: 2e-3 * float(np.mean(block.column("position"))), {}),
    "shared": (lambda block: 3e-3 / block.cases + 1e-4, {"whole": ("slope", "position")}),
    "shared and dear": (lambda block: 0.2 + 30.0 / block.cases, {"whole": ("slope",)}),
    "shared a little": (lambda block: 0.11 + 0.02 / block.cases, {"whole": ("position",)}),
    "distinct": (lambda block: 1e-3, {"distinct": lambda block: len(set(block.column("slope"))), "compiling": 7.0}),
}


def planned(template):
    last = tuple(count - 1 for count in template.grid)
    block = template.block(last)
    ends = [float(column[-1]) for column in block.columns.values()]
    return [
        f"chunks {[template.chunks[dim] for dim in template.dims]} grid {template.grid} shape {template.shape}",
        f"{template.cases} cases, {template.bytes} bytes, {template.files} files",
        f"in order {list(template.block_indices())[:3]}, last {template.region(last)}",
        f"block {block.cases} {block.realisations[-1]} {block.seed}",
        *short(template.seconds(last), template.seconds((0, 0, 0)), template.mean_seconds(template.chunks), *ends),
    ]


@pytest.mark.parametrize("goes_on", [False, True])
def test_record_of_plans(toy, monkeypatch, dataframe_regression, goes_on):
    found = {}
    for name, (seconds, changes) in COSTS.items():
        cost(toy, monkeypatch, seconds, **changes)
        for sizes, count in (((7, 31), 5), ((23, 3), 170), ((1, 1), 12), ((601, 11), 1)):
            positions, slopes = np.linspace(1, 2, sizes[0]), np.linspace(3, 9, sizes[1])
            study = toy.campaign(
                toy.axis("position", positions),
                toy.axis("slope", slopes),
                realisations=ROUNDS if goes_on else Replication(count, count, {}),
                outputs=("height", "trace", "width", "width_error"),
            )
            (template,) = plan.templates(study, study.replication.at_least)
            numbers = [float(each) for each in asdict(plan.estimate(study)).values() if isinstance(each, int | float)]
            found[f"{name}, {sizes}, {count}"] = [*planned(template), *short(*numbers, plan.estimate(study).rounds)]
    record.check(dataframe_regression, found)


def test_record_of_plans_that_cannot_be(toy, monkeypatch, dataframe_regression):
    found = {"words": []}
    axes = toy.axis("position", range(40_000)), toy.axis("slope", range(25_001))
    for name in ("", "far"):
        study = toy.campaign(*axes, name=name, realisations=Replication(1, 1, {}))
        found[f"too many {name}"] = said(plan.templates, study, 1)
    monkeypatch.setattr(plan, "available_memory", lambda: 2.0**30)
    for bytes_ in (2.0**30, 1.5 * 2.0**30):
        cost(toy, monkeypatch, lambda block: 1e-3, memory=lambda block, bytes_=bytes_: bytes_)
        found[f"memory {bytes_}"] = str(said(plan.templates, toy.campaign(toy.axis("position", [1.0])), 1))[:99]
    monkeypatch.undo()
    grows = (
        "name: a\nmodel: sliding_friction\nparameters: {length: 20 mm, rms_roughness: 1 um, shear_modulus: 10 MPa,\n"
    )
    grows += "  relaxation_time: 1 ms, normal_force: %s, velocity: %s}\nrealisations: 3\n"
    ends = "{adaptive: [1 N, 9 N], until: 1 %%, at_most: %d}"
    for most in (5, 6, 41):
        text = grows % (ends % most, "[1 mm/s, 2 mm/s, 9 mm/s]")
        estimate = plan.estimate(loads(text, "a.yaml", "."))
        numbers = estimate.growth, estimate.rounds, estimate.cases, estimate.solves, estimate.bytes
        found[f"growth {most}"] = short(*numbers)
    record.check(dataframe_regression, found)


def laid_out(url):
    """Return what stands in the metadata of a store, without what differs from run to run."""
    found = {}
    for path in sorted(Path(url).rglob("zarr.json")):
        held = json.loads(path.read_text())
        below = held.pop("consolidated_metadata", {"metadata": {}})["metadata"]
        held["attributes"] = {name: value for name, value in held["attributes"].items() if name not in MASKED}
        usual = ("chunk_key_encoding", "storage_transformers", "zarr_format", "node_type")
        told = [record.unversioned(f"{name} {json.dumps(value)}") for name, value in held.items() if name not in usual]
        found[str(path.relative_to(url))] = [*told, *sorted(below)]
    return found


def awkward(toy):
    """A study of two series, with names on an axis, further dimensions, and blocks that do not fit."""
    names = replace(toy.axis("position", [3.0, 1.0, 2.0]), labels=("c", "a", "b"), unit=None)
    study = toy.campaign(
        names, toy.axis("slope", [5.0, 2.0]), name="near", outputs=("height", "trace", "width", "width_error")
    )
    zipped = toy.axis("position", [4.0, 5.0, 4.0], "case"), toy.axis("noise", [0.1, 0.2, 0.1], "case")
    far = replace(study.series[0], name="far", axes=zipped)
    return replace(study, series=(study.series[0], far), blocks={"position": 2, "realisation": 4, "case": 2})


def test_record_of_layouts(toy, url, dataframe_regression):
    study = awkward(toy)
    store.lay_out(url, plan.templates(study, 5))
    found = {name: told for name, told in laid_out(url).items() if not re.match("near/.*(above|noise|slope)/", name)}
    for series in ("near", "far"):
        copy = copies.read_copy(url, series)
        found |= {f"{series}: copy": [*copy.files, *copy.study, *copy.own, *copy.members, str(len(copy.before))]}
    root = copies.root_of([copies.read_copy(url, name) for name in ("near", "far")], {})
    found |= {"root": [*root[0], *root[1], root[1]["comment"]]}
    found |= {
        f"{name}: {series}": str(data[name].to_numpy().tolist())
        for series, data in store.datasets(url).items()
        for name in data.coords
    }
    text = "name: a\nmodel: sliding_friction\nparameters: {length: 20 mm, rms_roughness: 1 um, shear_modulus: 10 MPa,\n"
    text += "  relaxation_time: 1 ms, normal_force: [1, 3], velocity: 1e-3}\naccuracy: 1 %\n"
    text += "outputs: [friction_coefficient]\n"
    (Path(url).parent / "m.csv").write_text("normal_force [N],friction_coefficient\n1,0.1\n2,0.2\n")
    measured = loads(text + "measured: {table: m.csv}\n", "a.yaml", str(Path(url).parent))
    store.lay_out(url + "2", plan.templates(measured, 2))
    found |= {f"sliding {name}": told for name, told in laid_out(url + "2").items() if name.count("/") < 1}
    found["sliding"] = [
        f"{name}: {sorted(attrs)}"
        for name, attrs in ((name, data.attrs) for name, data in store.datasets(url + "2")[""].variables.items())
    ]
    record.check(dataframe_regression, found)


def differences(toy):
    """Studies that are not the one of the store, and some that are."""
    study = awkward(toy)
    near, far = study.series
    labels = replace(near.axes[1], labels=("x", "y"), unit=None)
    return {
        "the same": study,
        "one series": replace(study, series=(far,)),
        "axes turned": replace(study, series=(replace(near, axes=near.axes[::-1]), far)),
        "another seed": replace(study, seed=7, accuracy=0.1),
        "without a name": replace(study, series=(replace(near, name=""),)),
        "named like an array": replace(study, series=(replace(near, name="status"), far)),
        "axes less": replace(study, series=(replace(near, axes=near.axes[:1]), far)),
        "names on numbers": replace(study, series=(replace(near, axes=(near.axes[0], labels)), far)),
        "more outputs": replace(study, outputs=(*study.outputs, "more", "most")),
        "other parameters": replace(
            study, series=(replace(near, parameters=near.parameters.model_copy(update={"noise": 0.7})), far)
        ),
        "more values": replace(
            study, series=(replace(near, axes=(near.axes[0], toy.axis("slope", [9.0, 2.0, 7.0, 5.0]))), far)
        ),
        "more names": replace(
            study,
            series=(
                replace(
                    near,
                    axes=(replace(toy.axis("position", [8.0, 2.0]), labels=("z", "b"), unit=None), near.axes[1]),
                ),
            ),
        ),
        "more cases": replace(
            study,
            series=(
                replace(
                    far,
                    axes=(
                        toy.axis("position", [4.0, 4.0, 4.0, 6.0], "case"),
                        toy.axis("noise", [0.1, 0.1, 0.1, 0.2], "case"),
                    ),
                ),
            ),
        ),
    }


def reconciled(url, study):
    stored = store.reconcile(url, study)
    axes = {
        series.name: [(a.path, a.values, a.labels, a.unit) for a in series.axes] for series in stored.campaign.series
    }
    places = {name: {dim: at.tolist() for dim, at in each.items()} for name, each in stored.places.items()}
    return [str(axes), str(places), str(stored.chunks), str(stored.realisations), str(stored.campaign.outputs)]


def test_record_of_campaigns_that_go_on(toy, url, dataframe_regression):
    store.lay_out(url, plan.templates(awkward(toy), 5))
    found = {name: said(reconciled, url, study) for name, study in differences(toy).items()}
    plain = toy.campaign(toy.axis("position", [1.0, 2.0]))
    store.lay_out(url + "2", plan.templates(plain, 5))
    own = replace(plain.series[0], name="near")
    for name, series in (
        ("beside", own),
        ("like an array", replace(own, name="height")),
        ("the same", plain.series[0]),
    ):
        found[f"at the root: {name}"] = said(reconciled, url + "2", replace(plain, series=(series,)))
    found["and grows"] = said(reconciled, url + "2", toy.campaign(toy.axis("position", [2.0, 3.0, 1.0])))
    found = {name: json.dumps(told).replace(url, "STORE") for name, told in found.items()}
    record.check(dataframe_regression, found)


@pytest.fixture
def in_order(monkeypatch):
    """Blocks one after the other; Dask takes those of a window in any order."""
    monkeypatch.setattr(executors, "THREAD_WINDOW", 1)


def told(event):
    facts = {name: value for name, value in event.facts.items() if name not in ("seconds", "cluster")}
    return f"{event.name}: {json.dumps(facts, sort_keys=True)} {event.sentence}"


def counted(progress):
    kept = [each.name for each in fields(progress) if "seconds" not in each.name]
    return [getattr(progress, name) for name in kept if name not in ("estimated", "finished")]


RUNS = {
    "plain": lambda toy: toy.campaign(toy.axis("position", [1.0, 2.0, 9.0]), fail_above=8.0),
    "two outputs that fail": lambda toy: toy.campaign(
        toy.axis("position", [9.0, 1.0]), toy.axis("slope", [2.0, 3.0]), outputs=("trace", "width"), fail_above=8.0
    ),
    "raises": lambda toy: toy.campaign(toy.axis("position", [9.0, 1.0]), outputs=("trace", "height"), raise_above=8.0),
    "blocks": lambda toy: replace(
        toy.campaign(toy.axis("position", [1.0, 2.0, 3.0]), outputs=("height", "trace")),
        blocks={"position": 2, "realisation": 4},
    ),
    "rounds in a block": lambda toy: toy.campaign(
        toy.axis("position", [1.0, 2.0, 3.0]),
        toy.axis("noise", [0.001, 0.1, 0.3]),
        realisations=Replication(5, 33, {"height": Tolerance(relative=0.05)}),
    ),
    "rounds of blocks": lambda toy: replace(
        toy.campaign(
            toy.axis("position", [1.0, 2.0]),
            toy.axis("noise", [0.001, 0.2]),
            realisations=Replication(4, 31, {"height": Tolerance(relative=0.05), "width": Tolerance(absolute=0.4)}),
            outputs=("height", "width"),
        ),
        blocks={"noise": 1, "realisation": 3},
    ),
    "rounds of failures": lambda toy: toy.campaign(
        toy.axis("position", [1.0, 9.0]),
        realisations=Replication(3, 9, {"height": Tolerance(relative=0.01)}),
        fail_above=8.0,
    ),
    "series": awkward,
}


def outcome_of(url, study):
    heard, reported = [], []
    run = execute.run(study, url, Resources(threads=1), reported.append, tell=lambda event: heard.append(told(event)))
    found = {"events": heard, "progress": counted(run), "reports": [sum(counted(each)) for each in reported]}
    for name, data in store.datasets(url).items():
        found[f"{name}: status"] = data["status"].to_numpy()
        for output in data.data_vars:
            found[f"{name}: {output}"] = data[output].to_numpy()
        records = sorted(store.records(url, name), key=lambda one: (one["block"], one["attempt"]))
        for one in records:
            kept = {key: one[key] for key in ("attempt", "block", "messages", "solves")}
            found[f"{name}: record {one['block']}"] = json.dumps(kept, sort_keys=True)[:400]
    again = execute.run(study, url, Resources(threads=1), lambda _: None, retry_failed=True)
    return found | {"again": counted(again), "outlook": counted(execute.outlook(study, url))}


def test_record_of_runs(toy, in_order, tmp_path, dataframe_regression):
    found = {}
    for name, make in RUNS.items():
        for what, value in outcome_of(str(tmp_path / f"{name}.zarr"), make(toy)).items():
            found[f"{name}: {what}"] = value
    record.check(dataframe_regression, found)


def test_record_of_parts(toy, in_order, tmp_path, dataframe_regression):
    found, url = {}, str(tmp_path / "parts.zarr")
    study = replace(RUNS["rounds of blocks"](toy), blocks={"position": 1, "noise": 1, "realisation": 2})
    for number in (2, 1, 3, 2, 1):
        heard = []
        run = execute.run(
            study,
            url,
            Resources(threads=1),
            lambda _: None,
            part=Part(number, 3),
            tell=lambda event, heard=heard: heard.append(told(event)),
        )
        found[f"run {len(found)}"] = [*short(*counted(run)), *heard]
    (template,) = plan.templates(study, 6)
    found["owners"] = np.concatenate([each.ravel() for each in cells.owners([template], 3)])
    found["dealt"] = [str(Part.of(position, count)) for count in (1, 2, 3, 5) for position in range(11)]
    record.check(dataframe_regression, found)


class Stand(Cluster):
    """A cluster that starts nothing and keeps what it is told."""

    told: ClassVar[list] = []

    def __init__(self, **arguments):
        self.told.append(sorted((name, str(value)[:36]) for name, value in arguments.items()))

    def scale(self, **how):
        self.told.append(("scale", sorted(how.items())))

    def adapt(self, **how):
        self.told.append(("adapt", sorted(how.items())))

    def close(self, *_):
        self.told.append("closed")

    __del__ = __repr__ = lambda self: ""


class Queue(Stand):
    job_cls = str


PLANS = [
    {},
    {"arguments": {"cores": 3, "threads_per_worker": 4}, "adapt": {"maximum": 7}},
    {"arguments": {"cores": 3, "threads_per_worker": 4}, "adapt": {"maximum_jobs": 7}},
    {"arguments": {"cores": 3}, "adapt": {"maximum_jobs": 2, "maximum": 9, "minimum": 1}},
    {"arguments": {"threads_per_worker": 2}, "scale": {"jobs": 5}},
    {"adapt": {"maximum": 6, "target_duration": "3s"}, "scale": {"n": 2}},
    {"adapt": {"maximum_jobs": 6}},
    {"arguments": {"security": False, "dashboard_address": "x"}},
    {"arguments": {"security": None, "scheduler_options": {"port": 1}}},
]


def test_record_of_clusters(tmp_path, monkeypatch, dataframe_regression):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(clusters, "cluster_class", lambda name: {"Stand": Stand, "Queue": Queue}[name])
    found = {"most": [clusters._most(plan_) for plan_ in PLANS], "local": json.dumps(clusters._local(3))}
    for kind in ("Stand", "Queue"):
        for number, plan_ in enumerate(PLANS):
            Stand.told = []
            with clusters._started({"class": kind, **plan_}):
                Stand.told.append([str(path.suffix or path.name[:15]) for path in tmp_path.iterdir()])
            found[f"{kind} {number}"] = re.sub("0x[0-9a-f]+|keys-[^']*", "", str(Stand.told))
    word = clusters._LastWord()
    for error in (None, OSError("no\n  such")):
        info = (type(error), error, None) if error else None
        word.emit(SimpleNamespace(exc_info=info, getMessage=lambda: "plain \n words"))
        found[f"last word {error!r}"] = word.text
    found["resources"] = [str(vars(Resources())), *(str(each.remote) for each in REMOTE)]
    found["settings"] = [str(clusters.ON_THIS_MACHINE), clusters.TARGET_DURATION, clusters.QUIET.replace("\n", " ")]
    record.check(dataframe_regression, found)


REMOTE = [Resources(), Resources(3), Resources(workers=2), Resources(scheduler="x"), Resources(cluster={})]


def test_record_of_stacks(dataframe_regression):
    draw = np.random.default_rng(5)
    found = {"weights": bootstrap.weights(7), "widening": bootstrap.widening([1, 2, 3, 12, 100])}
    for count, shape in ((1, (3,)), (2, (3,)), (9, (2, 41))):
        values = np.exp(draw.standard_normal((count, *shape)))
        values[0].flat[0] = np.nan
        stack = bootstrap.means(values)
        found[f"{count}: means"], found[f"{count}: complete"] = stack, bootstrap.complete(values)
        errors = 0.1 * draw.random(shape)
        errors.flat[1] = np.inf
        moved = bootstrap.moved(stack[0], errors)
        whole = np.concatenate([stack, moved])
        found[f"{count}: moved"], found[f"{count}: regrouped"] = moved, bootstrap.regrouped(whole)
        found[f"{count}: none moved"] = bootstrap.regrouped(np.concatenate([stack, stack[:1]] * 1))
        for positive in (False, True):
            for low_high, ends in zip(("low", "high"), bootstrap.interval(whole, count, positive), strict=True):
                found[f"{count}: {low_high} {positive}"] = ends
        found[f"{count}: chance"] = bootstrap.chance(np.nan_to_num(whole - 1.0), count)
    record.check(dataframe_regression, found)


def test_record_of_replications(dataframe_regression):
    found, many = {}, Replication(5, 77, {})
    growths = ([], [0.5], [1.0, 1.01], [1.3, 2.0, 9.0], [8.0], [1.2, 1.3], [3.0, 1.1, 1.2, 0.0], [np.inf])
    for count in (5, 13, 40, 70):
        found[f"next {count}"] = [replication.next_round(many, count, np.array(growth)) for growth in growths]
    draw = np.random.default_rng(3)
    until = {"a": Tolerance(relative=0.05), "b": Tolerance(absolute=0.02, relative=0.001)}
    for count in (1, 2, 6, 7, 12, 40):
        noise = draw.standard_normal((4, count)) * np.array([[0.0], [1e-5], [0.05], [0.4]])
        values = {"a": 1 + noise, "b": 0.3 - noise}
        status = np.full((4, count), Status.DONE, dtype=np.int8)
        status[3, ::2] = Status.FAILED
        found[f"needed {count}"] = np.minimum(replication.growth_needed(values, status, until), 1e9)
        within = {"a": np.full((4, count), 0.03)}
        found[f"within {count}"] = np.minimum(replication.growth_needed(values, status, until, within), 1e9)
        mean, error = replication.mean_and_error(values["a"], status == Status.DONE)
        found[f"mean {count}"], found[f"error {count}"] = mean, error
    found["none done"] = replication.growth_needed(values, np.zeros_like(status), until)
    record.check(dataframe_regression, found)


def test_record_of_progress_and_events(toy, dataframe_regression):
    found, state = {}, Progress(total=90, kept=7, estimated=55.0)
    counts = [0] * len(Status)
    for number, status in enumerate((Status.DONE, Status.FAILED, Status.NOT_CONVERGED, Status.NOT_NEEDED)):
        counts[status] = 3 + 2 * number
    outcomes = [
        task.Outcome(tuple(counts), 11, 2.0, 3.0, 0.5, 1.25, 2, 4, True),
        task.Outcome(tuple(counts), 5, 7.0, 1.0, 0.25, 9.0),
        task.Outcome(tuple(counts), 5, 60.0, 1.0, 0.25),
    ]
    for number, outcome in enumerate(outcomes):
        state = state.after(outcome, 1.3 * (number + 1))
        found[f"after {number}"] = short(*asdict(state).values())
        found[f"left {number}"] = short(state.to_do, state.seconds_left, outcome.seconds)
        work = SimpleNamespace(place=SimpleNamespace(series="far", index=(1, 2)), attempt=3)
        found[f"ended {number}"] = str(events.ended(work, outcome))
    found["none left"] = [str(Progress().seconds_left), str(replace(state, wall_seconds=0.0).seconds_left)]
    found["defaults"] = [str(Progress()), str(Event("x")), str(outcomes[2]), str(Hold("a", "b"))]
    wanted = np.array([[True, False, True], [False, True, True]])
    place = store.Place("u", "s", (0, 1), (slice(0, 2), slice(4, 7)), "m", Hold("", "o", 3))
    block = plan.templates(toy.campaign(toy.axis("position", [1.0, 2.0])), 3)[0].block((0, 0))
    work = task.Work(place, "toy", ("v", 1), block, wanted, ~wanted, 2, 5.0, task.Rounds(ROUNDS, 9))
    found["halves"] = [f"{half.wanted.tolist()} {half.estimate} {half.rounds}" for half in work.halves()]
    one = np.zeros_like(wanted)
    one[1, 1] = True
    found["no halves"] = str(replace(work, wanted=one).halves())
    grown = work.grown(5)
    found["grown"] = [
        str(grown.place.region),
        str(grown.block.realisations),
        str(grown.wanted.shape),
        str(grown.spared.any()),
    ]
    found["places"] = [str(task._place(work, case, number)) for case in range(2) for number in range(3)]
    found["longer"] = task._longer(np.arange(6.0).reshape(2, 3), 1, 5, -7.0)
    found["kind"] = [part.split(" ")[0] for part in task.kind().split(", ")]
    record.check(dataframe_regression, found)


def test_record_of_seals_and_histories(toy, url, dataframe_regression):
    study = RUNS["blocks"](toy)
    execute.run(study, url, Resources(threads=1), lambda _: None)
    seal = seals.read_seal(url, "")
    found = {"seal": [*seal.stamps, seal.series, str(len(seal.different)), str(seal.which.tolist())]}
    found["grown"] = [str(seal.contents(grid).tolist()) for grid in ((3, 3), (1, 2), (2, 1))]
    found["known"] = [str(np.sign(seal.known(name, (3, 2))).tolist()) for name in ("height", "none")]
    found["nothing"] = str(seals.Seal.nothing(files.ROOT, (2, 1)))
    for shape in ((3, 6), (5, 7), (2, 9), (4, 1)):
        found[f"ledger {shape}"] = ledgers.ledger(url, "", shape).ravel()
    found["no ledger"] = ledgers.ledger(url, "far", (2, 3)).ravel()
    held = store.study.document(url, "")
    chunks = seals.Chunks.of("", held)
    found["chunks"] = [*chunks.names("trace"), chunks.name("trace", (1, 0)), str(chunks.grid), str(chunks.further)]
    ledger = store.look(url, "").ledger
    only = ledger.only(np.array([[True, False], [False, True]]))
    found["only"] = [str(only.which.tolist()), str(len(only.different)), str([len(x) for x in only.digests])]
    status = np.zeros((5, 7), dtype=np.int8)
    status[4, 3] = status[0, 6] = Status.DONE
    found["done blocks"] = ledgers.done_blocks(status, (2, 3)).ravel()
    told_of = [
        {"attempt": 2, "block": [0, 0], "chunks": {"status": "s2", "a": "a2"}},
        {"attempt": 1, "block": [0, 0], "chunks": {"status": "s1", "a": "a1", "b": "b1"}},
        {"attempt": 4, "block": [0, 0], "chunks": {"a": "a4", "b": "b4"}},
        {"attempt": 3, "block": [0, 0], "chunks": {"status": "s2"}},
        {"attempt": 1, "block": [0, 1]},
    ]
    known = digests.histories(told_of)
    found["histories"] = json.dumps({str(block): list(each) for block, each in known.items()})
    for status_ in ("s1", "s2", "s3", None):
        found[f"allowed {status_}"] = [
            str(sorted(digests.allowed(known[0, 0], status_, name))) for name in ("a", "b", "c")
        ]
    named = ((series, member) for series in ("", "-", "far") for member in ("", "status"))
    found["names"] = [files.group_name(*pair) for pair in named]
    found["local"] = [str(files.local(url_)) for url_ in ("a/b", "file:///a", "s3://b/c")]
    found["kinds, attempts"] = [str(list(store.kinds(url, [""]).values())), str(store.attempts(url, ""))]
    record.check(dataframe_regression, found)


def faulty(root, change):
    held = json.loads(json.dumps(root))
    members = held["consolidated_metadata"]["metadata"]
    change(held, held["attributes"], members)
    return list(expected.faults(held))


FAULTS = {
    "none": lambda held, attrs, arrays: None,
    "format": lambda held, attrs, arrays: held.update(zarr_format=2),
    "no seed": lambda held, attrs, arrays: attrs.pop("seed"),
    "accuracy": lambda held, attrs, arrays: attrs.update(accuracy="1 %", history=[1]),
    "outputs": lambda held, attrs, arrays: attrs.update(outputs=[], blocks={"position": 0}),
    "parameters": lambda held, attrs, arrays: attrs.update(parameters="{"),
    "labels": lambda held, attrs, arrays: attrs["axes"][0].update(labels=[1]),
    "a name outside": lambda held, attrs, arrays: arrays.update({"../x": arrays["height"], "/y": arrays["height"]}),
    "a name with dots": lambda held, attrs, arrays: arrays.update({"a..b": arrays["height"]}),
    "a shape": lambda held, attrs, arrays: arrays["height"].update(shape=[3, -1]),
    "fewer lengths": lambda held, attrs, arrays: arrays["height"].update(shape=[3]),
    "no names": lambda held, attrs, arrays: arrays["height"].update(dimension_names=None),
    "other lengths": lambda held, attrs, arrays: arrays["height"].update(shape=[4, 6]),
    "large chunks": lambda held, attrs, arrays: chunk(arrays["height"], [10**6, 10**3 + 1]),
    "the largest chunks": lambda held, attrs, arrays: chunk(arrays["trace"], [10**6, 10**3, 1]),
    "no chunks": lambda held, attrs, arrays: chunk(arrays["height"], [0, 1]),
    "array less": lambda held, attrs, arrays: (arrays.pop("height"), arrays.pop("position")),
    "dimensions": lambda held, attrs, arrays: arrays["status"].update(dimension_names=["realisation", "multiple"]),
    "blocks": lambda held, attrs, arrays: attrs.update(blocks={"position": 2, "realisation": 3}),
    "a group": lambda held, attrs, arrays: arrays.update(far={"node_type": "group", "zarr_format": 2}),
    "too many": lambda held, attrs, arrays: [
        each.update(
            shape=[length if dim != "realisation" else 10**9 for dim, length in zip(dims, each["shape"], strict=True)]
        )
        for each in arrays.values()
        if "realisation" in (dims := each.get("dimension_names", ()))
    ],
    "codecs": lambda held, attrs, arrays: arrays["height"].update(codecs=[], storage_transformers=[{}]),
    "a codec": lambda held, attrs, arrays: arrays["height"].update(codecs=[{"name": "pickle"}]),
}


def chunk(array, shape):
    array["chunk_grid"]["configuration"]["chunk_shape"] = shape


def test_record_of_faults_of_metadata(toy, url, dataframe_regression):
    store.lay_out(url, plan.templates(RUNS["blocks"](toy), 6))
    root = json.loads(Path(url, "zarr.json").read_text())
    record.check(dataframe_regression, {name: faulty(root, change) for name, change in FAULTS.items()})


ROOMS = (bootstrap, plan, replication, task, clusters, crew, executors, rounds, digests, expected, files, seals, locks)
ROOMS += (layout, reading, runners, sound, verifying, definition, document, expand, measured, spec, variation)


def test_record_of_settings(dataframe_regression):
    """How long is waited, how often is asked, how much is held at a time."""
    record.check(
        dataframe_regression,
        {
            f"{room.__name__}.{name}": value
            for room in ROOMS
            for name, value in vars(room).items()
            if name.isupper() and isinstance(value, int | float | str | tuple) and name not in ("ROOT", "NO_LOCKS")
        },
    )
