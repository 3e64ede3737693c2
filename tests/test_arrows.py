"""The house keeps its arrows: who may import whom, who may import what, and what nobody below the commands does.

Read from the syntax trees, so imports inside functions and under TYPE_CHECKING count as well.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TOPS = ("dslam_mav", "missions", "sim_bridge")

BASE = "errors mission observations records"
SEEN = "errors observations records"  # legs are made of these alone: GPS-denied, so no mission with its places
LEGS = f"{BASE} legs legs.plan"
SIMULATED = "missions sim_bridge sim_bridge.fields"
READ = "export recordings series"
ALL = f"{LEGS} {READ} {SIMULATED} assumed assumptions calibrated dslam experiments files forecast log mav replay report"
SWEEP = "sweep sweep.points"

# room: (rooms of ours it may import besides itself, packages of others it may import); a room may have one within
HOUSE = {
    "records": ("", "numpy"),
    "errors": ("", ""),
    "observations": ("errors", "numpy"),
    "mission": ("errors", "numpy pymap3d"),
    "files": ("errors", ""),
    "assumptions": ("records", ""),
    "legs": (f"{SEEN} legs.plan", "numpy"),
    "legs.plan": ("mission", "numpy"),
    "dslam": ("records dslam.paper", "numpy scipy numba llvmlite threadpoolctl"),
    "dslam.paper": ("records dslam", "numpy scipy"),
    "mav": (LEGS, "pymavlink numpy"),
    "log": (f"{BASE} dslam", "mcap mcap_protobuf google foxglove foxglove_schemas_protobuf zstandard numpy"),
    "export": (f"{BASE} legs", "numpy pymap3d pyarrow"),
    "report": (f"{BASE} dslam", "jinja2 rich numpy"),
    "experiments": (f"{BASE} dslam dslam.paper experiments.pictures", "numpy scipy threadpoolctl"),
    "experiments.pictures": ("records experiments", "numpy matplotlib PIL"),
    "sweep": ("errors records experiments.pictures sweep.points", "numpy threadpoolctl pyarrow distributed matplotlib"),
    "sweep.points": ("records dslam", "numpy"),
    "assumed": (f"{LEGS} assumptions calibrated dslam", "numpy"),
    "calibrated": ("legs records assumptions", ""),
    "forecast": ("records assumptions dslam", "numpy"),
    "series": ("errors records", "numpy"),
    "recordings": (f"{LEGS} log mav replay series", "numpy"),
    "replay": (f"{LEGS} mav", ""),
    "flight_log": (f"{LEGS} export log recordings replay", "numpy pandas"),
    "dslam_mav": (f"{LEGS} dslam dslam.paper flight_log replay", ""),
    "missions": (f"{BASE} dslam files", "numpy scipy threadpoolctl"),
    "sim_bridge": (f"{BASE} mav sim_bridge.fields sim_bridge.loopback", "numpy"),
    "sim_bridge.fields": (f"{BASE} dslam log mav series", "numpy scipy msgspec"),
    "sim_bridge.loopback": (f"{BASE} mav", "numpy"),
    "commands": (f"{ALL} {SWEEP} experiments.pictures", "rich numpy msgspec"),
    "cli": ("errors commands", ""),
    "__main__": ("cli", ""),
}
MAY_TALK = {"commands", "cli", "__main__"}  # print, and end the process
IMPURE = {
    "os",
    "io",
    "pathlib",
    "shutil",
    "tempfile",
    "socket",
    "subprocess",
    "time",
    "datetime",
    "random",
    "logging",
    "sys",
}
RANDOM = {"default_rng", "Generator", "SeedSequence"}  # all else in numpy.random is global state


@dataclass(frozen=True)
class Module:
    name: str
    room: str
    tree: ast.Module
    imports: dict[str, list[int]]  # name of a module -> lines

    def outside(self) -> dict[str, list[int]]:
        return {name: lines for name, lines in self.imports.items() if name.split(".")[0] not in TOPS}


def room_of(name: str) -> str:
    """The innermost room of HOUSE that the module is in; a new one goes by its own name."""
    parts = name.removeprefix("dslam_mav.").split(".")
    within = ".".join(parts[:2])
    return within if within in HOUSE else parts[0]


def name_of(path: Path, root: Path) -> str:
    return ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")


def imported(tree: ast.Module, known: set[str]) -> dict[str, list[int]]:
    """`from package import x` names package.x where that is a module of ours, else package."""
    found: dict[str, list[int]] = {}
    for node in ast.walk(tree):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = "." * node.level + (node.module or "")
            names = [full if (full := f"{base}.{a.name}") in known else base for a in node.names]
        for name in names:
            found.setdefault(name, []).append(node.lineno)
    return found


def read_house(root: Path) -> list[Module]:
    paths = [path for top in TOPS for path in sorted((root / top).rglob("*.py"))]
    known = {name_of(path, root) for path in paths}
    modules = []
    for path in paths:
        name, tree = name_of(path, root), ast.parse(path.read_text(encoding="utf-8"))
        modules.append(Module(name, room_of(name), tree, imported(tree, known)))
    return modules


def wrong_arrows(modules: list[Module]) -> Iterator[str]:
    for module in modules:
        if module.room not in HOUSE:
            yield f"{module.name}: a new room; say in HOUSE what it may import"
            continue
        ours, theirs = (set(text.split()) for text in HOUSE[module.room])
        for name, lines in module.imports.items():
            top, room = name.split(".")[0], room_of(name)
            if name.startswith("."):
                yield f"{module.name}:{lines[0]}: a relative import"
            elif top in TOPS:
                if room not in ours | {module.room}:
                    yield f"{module.name}:{lines[0]}: {module.room} may not import {name}"
            elif top not in theirs and top not in sys.stdlib_module_names:
                yield f"{module.name}:{lines[0]}: {module.room} may not import {name}"


def cycles(modules: list[Module]) -> list[list[str]]:
    """Modules that reach themselves: what depth-first search meets again while it is still open."""
    graph = {m.name: [name for name in m.imports if name != m.name] for m in modules}
    state: dict[str, str] = {}
    found: list[list[str]] = []

    def visit(name: str, way: list[str]) -> None:
        state[name] = "open"
        for other in graph.get(name, ()):
            if state.get(other) == "open":
                found.append([*way[way.index(other) :], other])
            elif other in graph and other not in state:
                visit(other, [*way, other])
        state[name] = "done"

    for name in graph:
        if name not in state:
            visit(name, [name])
    return found


def talk(module: Module) -> Iterator[str]:
    """Where a module prints or ends the process."""
    for node in ast.walk(module.tree):
        said = ast.unparse(node) if isinstance(node, ast.Name | ast.Attribute) else ""
        if said in ("print", "sys.exit", "exit", "quit", "os._exit", "SystemExit", "sys.stdout", "sys.stderr"):
            yield f"{module.name}:{node.lineno}: {said}"


def global_random(module: Module) -> Iterator[str]:
    for node in ast.walk(module.tree):
        if not isinstance(node, ast.Attribute) or node.attr in RANDOM:
            continue
        if ast.unparse(node.value) in ("np.random", "numpy.random"):
            yield f"{module.name}:{node.lineno}: {ast.unparse(node)}"


@pytest.fixture(scope="module")
def house() -> list[Module]:
    return read_house(ROOT)


def test_every_room_keeps_its_arrows(house):
    assert len(house) > 80
    assert {m.room for m in house} <= set(HOUSE), "nothing is read that has no rule"
    assert list(wrong_arrows(house)) == []


def test_no_import_runs_in_a_circle(house):
    assert cycles(house) == []


@pytest.mark.parametrize(
    ("package", "room"),
    [
        ("pymavlink", "mav"),
        ("mcap", "log"),
        ("google", "log"),
        ("foxglove_schemas_protobuf", "log"),
        ("foxglove", "log"),
    ],
)
def test_a_format_is_known_in_one_room_only(house, package, room):
    users = {m.room for m in house for name in m.outside() if name.split(".")[0] == package}
    assert users == {room}


def test_the_vehicles_side_and_the_log_do_not_know_each_other(house):
    arrows = {(m.room, room_of(name)) for m in house for name in m.imports if name.split(".")[0] in TOPS}
    assert not arrows & {("mav", "log"), ("mav", "report"), ("mav", "commands"), ("log", "mav")}


def test_only_commands_know_the_simulation_and_the_mission_maker(house):
    theirs = ("missions", "sim_bridge")
    outside = [m for m in house if m.name.split(".")[0] not in theirs]
    users = {m.room for m in outside for name in m.imports if name.split(".")[0] in theirs}
    assert users <= {"commands", "cli"}


def test_the_estimator_knows_no_file_no_socket_and_no_clock(house):
    rooms = ("dslam", "dslam.paper", "legs", "legs.plan", "records", "observations", "assumptions", "sweep.points")
    pure = [m for m in house if m.room in rooms]
    assert len(pure) > 10
    known = [f"{m.name}: {name}" for m in pure for name in m.outside() if name.split(".")[0] in IMPURE]
    opened = [
        f"{m.name}:{node.lineno}: open"
        for m in pure
        for node in ast.walk(m.tree)
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "open"
    ]
    assert known + opened == []


def test_only_commands_print_or_end_the_process(house):
    assert [line for m in house if m.room not in MAY_TALK for line in talk(m)] == []


def test_nobody_draws_from_global_random_numbers(house):
    assert [line for m in house for line in global_random(m)] == []


BAD = {
    "dslam_mav/dslam/a.py": "def f():\n    from pymavlink import mavutil\n    print(np.random.normal())\n",
    "dslam_mav/log/b.py": "from dslam_mav.mav import c\n",
    "dslam_mav/mav/c.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import dslam_mav.log.b\n",
    "dslam_mav/records/arrays.py": "from . import errors\nimport sim_bridge\n",
    "dslam_mav/surprise.py": "import sys\nsys.exit(1)\n",
    "sim_bridge/__init__.py": "from dslam_mav.commands.fly import run\n",
}


def test_a_house_with_every_fault_is_told_so(tmp_path):
    for name, text in BAD.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    modules = read_house(tmp_path)
    assert sorted(wrong_arrows(modules)) == [
        "dslam_mav.dslam.a:2: dslam may not import pymavlink",
        "dslam_mav.log.b:1: log may not import dslam_mav.mav.c",
        "dslam_mav.mav.c:3: mav may not import dslam_mav.log.b",
        "dslam_mav.records.arrays:1: a relative import",
        "dslam_mav.records.arrays:2: records may not import sim_bridge",
        "dslam_mav.surprise: a new room; say in HOUSE what it may import",
        "sim_bridge:1: sim_bridge may not import dslam_mav.commands.fly",
    ]
    assert cycles(modules) == [["dslam_mav.log.b", "dslam_mav.mav.c", "dslam_mav.log.b"]]
    assert [line for m in modules for line in talk(m)] == [
        "dslam_mav.dslam.a:3: print",
        "dslam_mav.surprise:2: sys.exit",
    ]
    assert [line for m in modules for line in global_random(m)] == ["dslam_mav.dslam.a:3: np.random.normal"]
