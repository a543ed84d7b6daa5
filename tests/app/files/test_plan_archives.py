"""A plan of an uploaded robot goes out with the robot's files, and is checked from them alone."""

from __future__ import annotations

import json
import shutil
from contextlib import closing
from pathlib import Path

import pytest

from app.choices.object_choice import from_mesh
from app.compute.map_service import MapService
from app.compute.plan_service import PlanService
from app.files.archives import pack, unpack
from app.files.file_kinds import file_kind
from app.files.plan_formats import FORMATS, plan_file
from symgrasp.cli.main import main
from symgrasp.errors import InputError, PlanError, SymgraspError
from symgrasp.files import SCENES_DIR
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.planners.planning import plan_sequential
from symgrasp.scene.content import content_sha256, file_references
from tests.app.choices.test_object_choice import stl
from tests.app.robot_archives import plan_of_upload
from tests.conftest import load_small


def quiet(share: float) -> None:
    pass


@pytest.fixture(scope="module")
def upload(tmp_path_factory) -> Path:
    """The folder of an uploaded robot."""
    return tmp_path_factory.mktemp("upload")


@pytest.fixture(scope="module")
def plan(upload) -> Plan:
    """A plan of it."""
    return plan_of_upload(upload)


@pytest.fixture(scope="module")
def archive(plan, upload) -> bytes:
    """The file of the plan, after which the upload is gone."""
    name, content = plan_file(plan, "JSON", [upload])
    assert name == "bottle_on_table_sequential.zip"
    return content


@pytest.fixture
def files(archive, tmp_path) -> dict[str, bytes]:
    """The files in it: name → content."""
    paths = unpack("plan.zip", archive, tmp_path / "files")
    return {path.relative_to(tmp_path / "files").as_posix(): path.read_bytes() for path in paths}


@pytest.fixture
def there(tmp_path) -> Path:
    """An empty folder."""
    (tmp_path / "there").mkdir()
    return tmp_path / "there"


def decisions(plan: Plan) -> object:
    return plan.model_dump(exclude={"scene": True})


def test_a_plan_is_verified_from_its_archive_alone(archive, plan, upload, there, capsys, monkeypatch):
    unpack("plan.zip", archive, there)
    path = there / "bottle_on_table_sequential.json"
    assert str(upload) not in path.read_text(encoding="utf-8")
    gone = shutil.move(upload, there.parent / "gone")
    try:
        assert main(["verify", str(path), "--strict"]) == 0
        monkeypatch.chdir(there)
        assert main(["verify", path.name]) == 0
        loaded = Plan.load(path)
        assert decisions(loaded) == decisions(plan)
        assert FORMATS["TSR"][1](loaded).startswith("name: 'bottle_on_table: panda'")
        shutil.rmtree(there / "files1")
        assert main(["verify", str(path)]) == 1
        assert "files1/my_panda/urdf/panda.urdf" in capsys.readouterr().out
    finally:
        shutil.move(gone, upload)


def test_the_page_opens_the_archive_and_writes_it_again(archive, plan, there):
    assert file_kind(archive) == "plan"
    with closing(MapService()) as maps, closing(PlanService(maps, (SCENES_DIR,))) as service:
        opened = service.open(archive, "plan.zip", None, there, quiet)
        assert opened.report.failures == ()
        assert opened.scene
        assert opened.plan
        assert opened.scene.option == "plan.zip (upload)"
        assert set(opened.scene.assets.visuals) == {r.model.urdf for r in opened.scene.scene.robots.values()}
        assert decisions(opened.plan.plan) == decisions(plan)
        assert service.write(opened.plan.plan, "JSON", [there], quiet)[1] != b""
        again = plan_file(opened.plan.plan, "JSON", [there])[1]
    unpack("again.zip", again, there.parent / "again")
    (path,) = (there.parent / "again").glob("*.json")
    assert verify(Plan.load(path)).holds


def opened(files: dict[str, bytes], folder: Path) -> Plan | None:
    with closing(MapService()) as maps, closing(PlanService(maps, (SCENES_DIR,))) as service:
        found = service.open(pack(files.items()), "plan.zip", None, folder, quiet)
    return found.plan and found.plan.plan


@pytest.mark.parametrize(
    "reference", ["/etc/passwd", "../../../../../etc/passwd", "file:///etc/passwd", "files1/no.urdf"]
)
def test_an_archive_reads_no_other_file(reference, files, there):
    (name,) = (name for name in files if name.endswith(".json"))
    content = json.loads(files[name])
    content["scene"]["content"]["robots"][0]["urdf"] = reference
    with pytest.raises(PlanError, match=r"scene.sha256.*, that of scene.content"):
        opened({**files, name: json.dumps(content).encode()}, there)
    shutil.rmtree(there)
    there.mkdir()
    content["scene"]["sha256"] = content_sha256(content["scene"]["content"])
    with pytest.raises(SymgraspError, match=r"robots\[0\].urdf.*expected (a file of an installed )?package"):
        opened({**files, name: json.dumps(content).encode()}, there)


def test_the_robot_in_an_archive_reads_no_other_file(files, there):
    name = "files1/my_panda/urdf/panda.urdf"
    text = files[name].replace(b"package://my_panda/meshes", b"/etc/meshes")
    with pytest.raises(SymgraspError, match="a file of the archive, or of an installed package"):
        opened({**files, name: text}, there)


def test_an_archive_has_one_plan(files, there):
    (name,) = (name for name in files if name.endswith(".json"))
    with pytest.raises(InputError, match="one plan, with the robots it refers to"):
        opened({**files, "other.json": files[name]}, there)
    shutil.rmtree(there)
    there.mkdir()
    with pytest.raises(PlanError, match="JSON"):
        opened({**files, name: b"{"}, there)


def test_the_command_line_says_to_unpack_it(archive, tmp_path, capsys):
    (tmp_path / "plan.zip").write_bytes(archive)
    assert main(["verify", str(tmp_path / "plan.zip")]) == 2
    error = capsys.readouterr().err
    assert "once it is unpacked" in error
    assert error.count("\n") == 1


def test_without_uploads_a_plan_is_one_file(plan):
    assert plan_file(plan, "JSON", [])[0] == "bottle_on_table_sequential.json"


def test_a_plan_of_an_uploaded_mesh_needs_no_file():
    choice = from_mesh("can.stl", stl(), 1.0)
    scene = load_small("bottle_on_table").with_object(choice.name, choice.profile)
    name, content = plan_file(plan_sequential(scene), "JSON", [])
    plan = Plan.parse(content, name)
    files = [holder[key] for _, holder, key in file_references(plan.scene.content)]
    assert files == ["package://pybullet_data/franka_panda/panda.urdf"]
    assert verify(plan).holds
