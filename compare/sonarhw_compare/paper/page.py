"""The page of figures: every exhibit in the order of the paper, as a picture and as words.

Takes nothing but the model; hands on PNGs and the text of `figures.md`.
"""

from io import BytesIO
from textwrap import fill

from sonarhw_compare.paper import beam_figures as beam
from sonarhw_compare.paper import corner_figures as corners
from sonarhw_compare.paper import corridor_figures as corridor
from sonarhw_compare.paper import laboratory_figures as laboratory
from sonarhw_compare.paper import plate_figures as plates
from sonarhw_compare.paper import ray_figures as rays
from sonarhw_compare.paper import simple_room_figures as simple_room
from sonarhw_compare.paper import single_reflection_figures as single_reflections
from sonarhw_compare.paper.exhibit import Claim, Exhibit

PAGE = "figures.md"
EXHIBITS: tuple[Exhibit, ...] = (
    *plates.EXHIBITS,
    *laboratory.EXHIBITS,
    *beam.EXHIBITS,
    *single_reflections.EXHIBITS,
    *simple_room.EXHIBITS,
    *corners.EXHIBITS,
    *rays.EXHIBITS,
    *corridor.EXHIBITS,
)
_HEAD = """\
# The paper's figures

Every figure of Dudek, Jenkin, Milios, Wilkes, *Reflections on modelling a sonar range sensor* (CIM-92-9), drawn
again by the model, with what the paper says should be seen and whether it is. `sonarhw figures DIR` makes this page
and its pictures, and the tests hold every line of it. With each figure stand the commands that predict the same. The
paper's own pictures are not here, nor are readings taken off them: what is held is what its text and its measures say.
Plans are cut where they would show little but far readings.
"""


def picture_name(exhibit: Exhibit) -> str:
    """Name of an exhibit's picture, beside the page."""
    return f"{exhibit.name}.png"


def picture(exhibit: Exhibit) -> bytes:
    """The exhibit as PNG."""
    out = BytesIO()
    # without the version of matplotlib in it the same picture is the same file
    exhibit.draw().savefig(out, format="png", bbox_inches="tight", metadata={"Software": None})
    return out.getvalue()


def claims(exhibit: Exhibit) -> tuple[Claim, ...]:
    """What the paper says of an exhibit, held against the model."""
    return tuple(claim() for claim in exhibit.claims)


def page() -> str:
    """The text of the page, Markdown."""
    return "\n".join((_HEAD, *(_section(exhibit) for exhibit in EXHIBITS)))


def _section(exhibit: Exhibit) -> str:
    lines = [f"## {exhibit.title}", "", fill(exhibit.setting, 118), ""]
    if exhibit.scenes:
        lines += ["```", *(scene.command for scene in exhibit.scenes), "```", ""]
    lines += [f"![{exhibit.title}]({picture_name(exhibit)})", ""]
    lines += ["| the paper says | here | seen |", "|---|---|---|"]
    lines += [_row(claim) for claim in claims(exhibit)]
    return "\n".join((*lines, ""))


def _row(claim: Claim) -> str:
    return f"| {claim.says} | {claim.measured} | {'yes' if claim.holds else '**no**'} |"
