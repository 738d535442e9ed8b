"""A scene that can be written to a file, with the texts of its room and its board."""

from pydantic import BaseModel, ConfigDict
from sonarhw_sim.board.profile import parse_board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Place, parse_room

from sonarhw_gui.scene.scene import Scene


class SceneMemory(BaseModel):
    """The stored form of a scene."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    room_text: str
    room_file: str
    place: Place | None
    board_text: str
    options: PredictionOptions

    @staticmethod
    def of(scene: Scene) -> "SceneMemory":
        """Return the stored form of a scene."""
        return SceneMemory(
            room_text=scene.room.text if scene.room else "",
            room_file=scene.room_file,
            place=scene.place,
            board_text=scene.board.text,
            options=scene.options,
        )

    def scene(self) -> Scene:
        """Return the scene. Raises InputError if room or board is invalid."""
        board = parse_board(self.board_text, "the board of the last session")
        room = parse_room(self.room_text, "the room of the last session") if self.room_text else None
        return Scene(room, self.place if room else None, board, self.room_file, self.options)
