"""What memory there is: of the machine, of its control groups, of the job; and what is said when it is too little."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbem.case.build import parse_model
from pbem.errors import LaunchError
from pbem.forecast import forecast
from pbem.forecast.forecast import Forecast, exceeds_at_most, note_memory, refuse_memory
from pbem.forecast.limits import Limit, read_available, read_limits
from pbem.mesh.generate import generate_mesh
from pbem.solve.launch import memory
from pbem.solve.launch.memory import judge_memory
from tests.unit.results_sample import make_mesh, make_model

MEMINFO = "MemTotal:       1000 kB\nMemFree:         10 kB\nMemAvailable:    600 kB\nHugePages_Total:   0\n"
GB = 1024.0**3


def read(folder: Path, environ: dict[str, str], membership: str = "") -> list[tuple[float, str]]:
    (folder / "meminfo").write_text(MEMINFO)
    (folder / "membership").write_text(membership)
    found = read_limits(environ, folder / "meminfo", folder / "cgroup", folder / "membership")
    return [(limit.bytes, limit.source) for limit in found]


def test_the_machine_has_its_memory(tmp_path: Path) -> None:
    assert read(tmp_path, {}) == [(1024000.0, "the machine's memory")]
    assert read_available(tmp_path / "meminfo") == 600 * 1024.0
    assert read_available(tmp_path / "none") is None
    assert read_limits({}, tmp_path / "none", tmp_path / "none", tmp_path / "none") == []


@pytest.mark.parametrize(("membership", "place", "name"), [
    ("0::/job/step\n", "job", "memory.max"),  # version 2: the group above limits it too
    ("4:memory:/job\n1:cpu:/other\n", "memory/job", "memory.limit_in_bytes"),
])  # fmt: skip
def test_control_groups_limit_it(tmp_path: Path, membership: str, place: str, name: str) -> None:
    folder = tmp_path / "cgroup" / place
    folder.mkdir(parents=True)
    (folder / name).write_text("5000\n")
    assert read(tmp_path, {}, membership)[0] == (5000.0, f"{name} of the control group")
    for unlimited in ("max\n", "9223372036854771712\n"):
        (folder / name).write_text(unlimited)
        assert len(read(tmp_path, {}, membership)) == 1


@pytest.mark.parametrize(("environ", "size"), [
    ({"SLURM_MEM_PER_NODE": "2048"}, 2 * GB),
    ({"SLURM_MEM_PER_NODE": "2G"}, 2 * GB),
    ({"SLURM_MEM_PER_CPU": "512", "SLURM_CPUS_ON_NODE": "4"}, 2 * GB),
    ({"PBS_RESC_MEM": "2147483648"}, 2 * GB),
    ({"SLURM_MEM_PER_NODE": "0"}, None),  # all there is
    ({"SLURM_MEM_PER_NODE": "much"}, None),
    ({"SLURM_MEM_PER_CPU": "512"}, None),
])  # fmt: skip
def test_batch_systems_tell_it(tmp_path: Path, environ: dict[str, str], size: float | None) -> None:
    found = [bytes_ for bytes_, source in read(tmp_path, environ) if source != "the machine's memory"]
    assert found == ([] if size is None else [size])


def make_forecast(size: float, ranks: int = 4) -> Forecast:
    return Forecast(ranks, 1000, "dense", {"operator": size}, size / ranks, {}, 0.0, False)


def test_a_node_that_grants_less_is_refused_with_the_numbers() -> None:
    limits = [Limit(3e9, "SLURM_MEM_PER_NODE"), Limit(9e9, "the machine's memory")]
    said = refuse_memory(make_forecast(8e9), 4, limits)
    assert said is not None
    for part in ("8 GB on 4 ranks", "SLURM_MEM_PER_NODE grants 3 GB", "PBEM_ALLOW_MEMORY=1", "1000"):
        assert part in said
    assert refuse_memory(make_forecast(8e9), 1, limits) is None  # a quarter of it on this node
    assert refuse_memory(make_forecast(8e9), 4, []) is None
    assert note_memory(make_forecast(8e9), 4, 9e9) is None and note_memory(make_forecast(8e9), 4, None) is None
    assert "7 GB can be had now" in (note_memory(make_forecast(8e9), 4, 7e9) or "")


def test_a_run_is_refused_unless_the_user_wants_it(monkeypatch: pytest.MonkeyPatch) -> None:
    model = make_model()
    mesh = make_mesh(model)
    monkeypatch.setattr(memory, "make_forecast", lambda *_, **__: make_forecast(8e9, ranks=2))
    small = [[([Limit(1e8, "memory.max")], 1e12)], [([Limit(1e12, "memory.max")], 1e12)]]
    with pytest.raises(LaunchError, match=r"4 GB on 1 rank of 2, but memory\.max grants 0\.1 GB"):
        judge_memory(model, mesh, small, allowed=False)
    (note,) = judge_memory(model, mesh, small, allowed=True)
    assert "4 GB on 1 rank of 2" in note and "\n" not in note
    assert judge_memory(model, mesh, [[([Limit(1e12, "memory.max")], 1e12)]], allowed=False) == ()
    assert judge_memory(model, mesh, [[([], None)]], allowed=False) == ()
    (note,) = judge_memory(model, mesh, [[([Limit(1e12, "memory.max")], 1e8)] * 2], allowed=False)
    assert "can be had now" in note


def write_cracks(operator: str) -> str:
    """Cracks in a plane without end, none of them near to another."""
    names = [f"c{k}" for k in range(100)]
    lines = [f"{name} = {{ points = [[{k % 10}, {k // 10}], [{k % 10 + 0.5}, {k // 10 + 0.2}]], elements = 10 }}"
             for k, name in enumerate(names)]
    return "\n".join([
        "[materials]\nrock = { young = 1e3, poisson = 0.2 }", "[curves]", *lines,
        f'[regions]\nplane = {{ material = "rock", boundary = [], infinite = true, cracks = {names} }}',
        "[interfaces]", *(f"{name} = {{ friction = 0.6 }}" for name in names), "[remote]\nsyy = -1.0",
        f'[solver]\noperator = "{operator}"\n',
    ])


def write_case(name: str, operator: str) -> str:
    return Path("cases", f"{name}.toml").read_text() + f'\n[solver]\noperator = "{operator}"\n'


@pytest.mark.parametrize("operator", ["dense", "hierarchical"])
@pytest.mark.parametrize("name", ["crack_field", "layers_pull", "cracks"])
def test_what_no_run_takes_is_more_than_the_forecast(name: str, operator: str) -> None:
    _, model = parse_model(write_cracks(operator) if name == "cracks" else write_case(name, operator))
    mesh = generate_mesh(model)
    for ranks in (1, 2, 8):
        needed = forecast.make_forecast(model, mesh, ranks, timed=False).rank_memory
        assert exceeds_at_most(model, mesh, ranks, needed)


def test_cracks_alone_need_no_forecast_where_memory_is_ample() -> None:
    # Factors of bodies take more for each unknown.
    for text, needs in ((write_cracks("hierarchical"), False), (write_case("layers_pull", "hierarchical"), True)):
        _, model = parse_model(text)
        mesh = generate_mesh(model)
        assert exceeds_at_most(model, mesh, 2, 2 * forecast.STARTED + 8e4 * mesh.nodes) == needs
