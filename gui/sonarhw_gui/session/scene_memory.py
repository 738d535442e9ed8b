"""A scene as values that can be written to a file, with its room and board as the text of their files."""

from pydantic import BaseModel, ConfigDict
from sonarhw_sim.board.profile import parse_board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.model import Place, parse_room

from sonarhw_gui.scene.scene import Scene


class SceneMemory(BaseModel):
    """What is remembered of a scene."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    room_text: str
    room_file: str
    place: Place | None
    board_text: str
    options: PredictionOptions

    @staticmethod
    def of(scene: Scene) -> "SceneMemory":
        """Return what is to be remembered of a scene."""
        return SceneMemory(
            room_text=scene.room.text if scene.room else "",
            room_file=scene.room_file,
            place=scene.place,
            board_text=scene.board.text,
            options=scene.options,
        )

    def scene(self) -> Scene:
        """Return the scene. Raises InputError."""
        board = parse_board(self.board_text, "the board of the last session")
        room = parse_room(self.room_text, "the room of the last session") if self.room_text else None
        return Scene(room, self.place if room else None, board, self.room_file, self.options)
