"""The reference page of room files and board profiles is up to date, and their JSON Schemas accept what is shipped."""

import re
import runpy
import tomllib

import pytest
from sonarhw_sim.board.profile import BoardFile
from sonarhw_sim.files import TomlModel, json_schema
from sonarhw_sim.room.room_file import RoomFile

from tests.checkout import CHECKOUT
from tests.oracles.schema_check import fits

PAGE = (CHECKOUT / "docs/reference/file_formats.md").read_text()
SHIPPED = [
    *((RoomFile, path) for path in sorted((CHECKOUT / "rooms").glob("*.toml"))),
    *((BoardFile, path) for path in sorted((CHECKOUT / "sim/sonarhw_sim/board/shipped").glob("*.toml"))),
    (RoomFile, CHECKOUT / "sim/sonarhw_sim/room/template.toml"),
    (BoardFile, CHECKOUT / "sim/sonarhw_sim/board/template.toml"),
]
ROOM = (CHECKOUT / "rooms/laboratory.toml").read_text()


def test_the_page_is_generated_from_the_models() -> None:
    generated = runpy.run_path(str(CHECKOUT / "docs/site/file_formats.py"))
    assert generated["page"]() == PAGE, "run: python docs/site/file_formats.py"


@pytest.mark.parametrize("name", ["heading_deg", "closed", "edges", "height", "range_offset", "separation", "cycles"])
def test_the_page_has_every_key(name: str) -> None:
    assert f"| `{name}` |" in PAGE


@pytest.mark.parametrize("heading", ["[floor]", "[air]", "[mount]", "[ring]", "[[chirp]]", "[places.NAME]"])
def test_the_page_has_every_table(heading: str) -> None:
    assert f"### `{heading}`" in PAGE


@pytest.mark.parametrize(("model", "path"), SHIPPED, ids=lambda value: getattr(value, "stem", ""))
def test_the_schema_accepts_every_shipped_file(model: type[TomlModel], path: object) -> None:
    assert fits(tomllib.loads(path.read_text()), json_schema(model))  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("name =", "nam ="),
        ("points =", "pionts ="),
        ("reflectance = ", "reflectance = 1"),
        ("reflectance = ", 'reflectance = "high" #'),
        ("closed = true", "closed = 1"),
        ("position = [", "position = [1.0, "),
        ("[[walls]]", "[[wall]]"),
        ("position = [", "heading_deg = 1e6\nposition = ["),
        ("[[walls]]\nname = \"", "[[walls]]\nname = \"a/b"),
    ],
)  # fmt: skip
def test_the_schema_refuses_what_the_model_refuses(old: str, new: str) -> None:
    assert old in ROOM
    changed = tomllib.loads(ROOM.replace(old, new, 1))
    assert not fits(changed, json_schema(RoomFile))
    with pytest.raises(ValueError, match="validation error"):
        RoomFile.model_validate(changed)


@pytest.mark.parametrize("model", [RoomFile, BoardFile])
def test_templates_show_every_key(model: type[TomlModel]) -> None:
    folder = "room" if model is RoomFile else "board"
    text = (CHECKOUT / f"sim/sonarhw_sim/{folder}/template.toml").read_text()
    schema = json_schema(model)
    keys = {key for table in (schema, *schema["$defs"].values()) for key in table.get("properties", {})}
    assert {key for key in keys if not re.search(rf"\b{key}\b", text)} == set()
